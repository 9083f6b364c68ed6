"""Impulses of supports on patches, and the work of their forces."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.sparse.linalg import lsmr

from tawami.base.arrays import Array, Mask
from tawami.base.rows import Rows
from tawami.conditions.held_border import HeldBorder
from tawami.field.layout import Layout

#: Relative tolerance of least squares.
DIGITS = 1e-12


class Impulses:
    """The nearest velocities that obey supports on patches, as `Reduction.imposed` for the others.

    With the means C over patches, patches x coefficients, velocities change by M^-1 C^T p, where p are
    the impulses. Fixed coefficients stay.

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
        mass, fixed = layout.whole(mass), layout.whole(fixed.astype(float)) > 0
        n = len(mass)
        means = Rows.stacked([held[k].means for k in self._chosen])
        self._means = means.columns(slice(0, n))
        self._loose = (mass > 0) & ~fixed
        inverse = np.divide(1.0, mass, out=np.zeros(n), where=self._loose)
        self._weighted = self._means.scaled(inverse)
        sizes, vectors = np.linalg.eigh((self._means.csr @ self._weighted.csr.T).toarray())
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
        impulse = self._inverse @ (prescribed - self._means.times(self._layout.whole(values)))
        return np.asarray(values + self._layout.part(self._weighted.transposed_times(impulse)))

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
        whole, loose = self._layout.whole, self._means.scaled(self._loose.astype(float))
        multipliers = lsmr(loose.transposed.csr, whole(forces), atol=DIGITS, btol=DIGITS)[0]
        return float(multipliers @ self._means.times(whole(u)))
