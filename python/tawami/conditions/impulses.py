"""Impulses of supports on patches, and the work of their forces."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.sparse.linalg import lsmr

from tawami.base import ranks
from tawami.base.arrays import Array, Mask
from tawami.base.rows import Rows
from tawami.conditions.held_border import HeldBorder
from tawami.field.layout import Layout

#: Relative tolerance of least squares.
DIGITS = 1e-12


class Impulses:
    """The nearest velocities that obey supports on patches, as `Reduction.imposed` for the others.

    With the means C over patches, patches x coefficients, velocities change by M^-1 C^T p, where p are
    the impulses. Fixed coefficients stay. Each rank has the columns of its own coefficients.

    Args:
        layout: Places of the coefficients.
        held: The supports; those of fields are ignored.
        mass: Mass of each displacement coefficient [kg per metre depth].
        fixed: Whether other supports prescribe each of them.
    """

    def __init__(
        self, layout: Layout, held: Sequence[HeldBorder], mass: Array, fixed: Mask
    ) -> None:
        self._layout = layout
        self._chosen = [k for k, one in enumerate(held) if not one.support.is_field]
        if not self._chosen:
            return
        n = len(mass)
        means = Rows.stacked([held[k].means for k in self._chosen])
        self._means = means.columns(slice(0, n))
        self._loose = (mass > 0) & ~fixed
        inverse = np.divide(1.0, mass, out=np.zeros(n), where=self._loose)
        self._weighted = self._means.scaled(inverse)
        matrix = (self._means.csr @ self._weighted.csr.T).toarray()
        sizes, vectors = np.linalg.eigh(ranks.sum_of(layout.grid.comm, matrix))
        # patches that others hold too have no forces
        large = sizes > len(sizes) * np.finfo(float).eps * sizes.max(initial=0.0)
        self._inverse = (vectors[:, large] / sizes[large]) @ vectors[:, large].T

    def imposed(self, rates: Sequence[Array], values: Array) -> Array:
        """Velocities after the impulses.

        Args:
            rates: Rate of the mean of each patch of each support [m/s]; none if all are at rest.
            values: Velocities, or other rates, of the displacement coefficients.
        """
        if not self._chosen:
            return values
        prescribed = np.concatenate([rates[k] for k in self._chosen]) if rates else 0.0
        impulse = self._inverse @ (prescribed - self._times(values))
        return np.asarray(values + self._layout.sum(self._weighted.transposed_times(impulse)))

    def _times(self, values: Array) -> Array:
        """Means over the patches; a call for all ranks."""
        return ranks.sum_of(self._layout.grid.comm, self._means.times(values))

    def work(self, forces: Array, u: Array) -> float:
        """Work of the supports, given the forces out of balance without them.

        Args:
            forces: On the displacement coefficients [N per metre depth]; the part that the supports
                cannot exert does no work. Theirs is the nearest by least squares: the inverse mass as
                a weight would let functions with little mass decide.
            u: Increments of the displacement coefficients [m].
        """
        if not self._chosen:
            return 0.0
        loose = self._means.scaled(self._loose.astype(float))
        # of the functions near the border, on every rank
        parts = loose.row, self._layout.in_grid[loose.column], loose.values, forces[loose.column]
        row, number, values, force = (ranks.allgathered(self._layout.grid.comm, p) for p in parts)
        _, first, column = np.unique(number, return_index=True, return_inverse=True)
        near = Rows.of(row, column, values, (loose.shape[0], len(first)))
        multipliers = lsmr(near.transposed.csr, force[first], atol=DIGITS, btol=DIGITS)[0]
        return float(multipliers @ self._times(u))
