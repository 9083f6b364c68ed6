"""Supports off the lines of the grid: means over patches of the border are held by tractions.

The tractions are multipliers of an augmented Lagrangian. They need no stress at the border, so that they
serve for all laws, forms and strain measures, and each pass leaves about a hundredth of the error.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import scipy.sparse as sp

from tawami.base.arrays import Array, Mask
from tawami.border.patches import patches
from tawami.border.tied import Tied
from tawami.field.constraints import PointHeld
from tawami.scene.domain import Domain
from tawami.scene.moving_points import MovingPoints
from tawami.scene.support import Support

#: Penalty of a patch per cell, in shear moduli (besides K), or in diagonal entries of the tangent.
PENALTY = 200.0
#: Change of the tractions by a pass, relative to the largest, below which no other is needed.
SETTLED = 1e-4
#: Share of the error that a pass may leave, factor of the penalty if it leaves more, and largest factor.
SLOW, STIFFER, STIFFEST = 0.3, 10.0, 1e4
#: Error of a held displacement that is round-off, relative to the displacement.
ALIKE = 1e-6
#: Displacement that is round-off [cells].
ROUND_OFF_OF_GRID = 1e-13


class HeldBorder:
    """A support on points of the border, in one step (`tawami.solve.terms`).

    Args:
        domain: The particles at its start.
        support: The support.
        values: Prescribed values at its points at the end of the step, counted as `before`: all of
            those at small strain, the increments where particles move.
        before: Coefficients at the start, which the values include.
        chosen: Mask of the points that it holds; by default all that it holds by tractions.
    """

    smooth, implicit = True, False

    def __init__(
        self,
        domain: Domain,
        support: Support,
        values: Array,
        before: Array,
        chosen: Mask | None = None,
    ) -> None:
        assert isinstance(support.place, MovingPoints)
        self._support, self._domain = support, domain
        self._weak = np.flatnonzero(support.weak if chosen is None else chosen)
        place, names = support.place, domain.layout.fields
        self._place = (
            names[str(support.component)] if support.is_field else next(iter(names.values()))
        )
        directions = np.ones((len(place), 1)) if support.is_field else support.directions
        self._directions = directions[self._weak]
        functions = place.cells(domain).values(self._place.basis)[self._weak]
        components = sp.identity(self._place.components)
        #: Values at the points, of all coefficients of the field: points components x coefficients.
        self._at_points = sp.kron(functions, components, format="csr")
        self._groups = patches(place.now[self._weak], domain.model.grid.h)
        self._weights = place.weight[self._weak]
        self._before = self._at_points @ before[self._place.slice]
        self._given = values[self._weak]
        self._values = (values + support.missing)[self._weak][:, None]
        self.prescribed = float(np.abs(self._values).max(initial=0.0))
        held = self._groups.means(self._weights, support.held[self._weak])
        self._held, self._largest, self._stiffened = held[:, None], np.inf, 1.0
        K, mu = (m[place.cells(domain).location.cell] for m in domain.moduli_of_cells)
        self._elastic = (K + PENALTY * mu)[self._weak]
        self._tied = self._with_penalty(self._elastic)

    @property
    def x(self) -> Array:
        """Positions of its points [m], points x dim."""
        assert isinstance(self._support.place, MovingPoints)
        return np.asarray(self._support.place.x[self._weak])

    @property
    def length(self) -> Array:
        """Length of the border at each of its points [m]."""
        assert isinstance(self._support.place, MovingPoints)
        return np.asarray(self._support.place.length[self._weak])

    @property
    def support(self) -> Support:
        """The support."""
        return self._support

    def _with_penalty(self, penalty: Array) -> Tied:
        """Ties with a penalty, given at each point [Pa]."""
        penalty = self._groups.means(self._weights, penalty) / self._domain.model.grid.h
        return Tied(self._groups, self._weights, self._directions[None], penalty)

    def begin(self, diagonal: Callable[[], Array], inertia: Array | None) -> None:
        """See `Term`. The penalty of a field has the size of its tangent, and in dynamics that of a
        displacement contains inertia.
        """
        if self._support.is_field:
            self._tied = self._with_penalty(PENALTY * self._near(diagonal()))
        elif inertia is not None:
            self._tied = self._with_penalty(self._elastic + PENALTY * self._near(inertia))

    def _near(self, diagonal: Array) -> Array:
        """Stiffness that the diagonal of a matrix stands for at each point [Pa]."""
        assert isinstance(self._support.place, MovingPoints)
        h, dim = self._domain.model.grid.h, self._domain.model.space.dim
        thickness = (self._support.place.weight / self._support.place.length)[self._weak]
        near = (abs(self._at_points) @ diagonal[self._place.slice]).reshape(len(thickness), -1)
        return np.asarray(near[:, 0] / thickness / h ** (dim - 2))

    def _displacement(self, coefficients: Array) -> Array:
        moved = self._before + self._at_points @ coefficients[self._place.slice]
        return np.asarray(moved.reshape(len(self._weak), -1))

    def forces(self, coefficients: Array) -> Array:
        """See `Term`."""
        u = self._displacement(coefficients)
        self._tractions = self._tied.multipliers(u, self._values, self._held)
        self._on_points = self._tied.forces(u, self._values, self._held)
        self._error = self._tied.error(u, self._values)
        self._size = float(np.abs(u).max(initial=0.0))
        forces = np.zeros_like(coefficients)
        forces[self._place.slice] = self._at_points.T @ self._on_points.ravel()
        self.on_body = forces
        return forces

    def stiffness(self) -> sp.csr_matrix:
        """See `Term`."""
        matrix = (self._at_points.T @ self._tied.stiffness() @ self._at_points).tocoo()
        size, first = self._domain.layout.size, self._place.start
        places = (matrix.row + first, matrix.col + first)
        return sp.coo_matrix((matrix.data, places), shape=(size, size)).tocsr()

    def improve(self) -> bool:
        """See `Term`."""
        change = np.abs(self._tractions - self._held).max(initial=0.0)
        self._held = self._tractions
        size = max(self.prescribed, self._size)
        error, before = np.abs(self._error).max(initial=0.0), self._largest
        if error > SLOW * before and self._stiffened < STIFFEST:
            self._stiffened *= STIFFER
            self._tied = replace(self._tied, penalty=STIFFER * self._tied.penalty)
        self._largest = error
        least = 0.0 if self._support.is_field else ROUND_OFF_OF_GRID * self._domain.model.grid.h
        noise = error <= max(ALIKE * size, least)
        return bool(change > SETTLED * np.abs(self._held).max(initial=0.0) and not noise)

    @property
    def unsettled(self) -> str:
        """See `Term`."""
        error, support = np.abs(self._error).max(), self._support
        return (
            f"{support}: its part of the border stays {error:.3g} {support.unit} away from the "
            f"prescribed values of '{support.axis}': other supports hold it, or the body cannot deform "
            "like this: expected supports that agree; change or release one"
        )

    def accept(self) -> None:
        """Keep the tractions, and what is missing of the prescribed displacement, for later steps."""
        support, number = self._support, self._groups.number
        support.held[self._weak] = self._tractions[number, 0]
        if self._domain.model.moves:
            support.missing[self._weak] = -self._error[number, 0]

    @property
    def resultants(self) -> dict[str, Array]:
        """Force on the body at each part of the border that the support covers [N per metre depth]."""
        assert isinstance(self._support.place, MovingPoints)
        made, resultant = self._support.place.made, self._domain.model.space.resultant
        tags = made.tag[self._weak]
        return {
            made.names[tag]: resultant(self._on_points[tags == tag].sum(axis=0))
            for tag in np.unique(tags)
        }

    @functools.cached_property
    def means(self) -> sp.csr_matrix:
        """Mean of the held component over each patch, of all coefficients: patches x coefficients."""
        dim, points = self._directions.shape[1], len(self._weak)
        shares = self._groups.shares(self._weights)[:, None] * self._directions
        places = (np.repeat(self._groups.number, dim), np.arange(points * dim))
        shape = (self._groups.count, points * dim)
        of_points = sp.csr_matrix((shares.ravel(), places), shape=shape)
        rows = (of_points @ self._at_points).tocoo()
        size, columns = self._domain.layout.size, rows.col + self._place.start
        return sp.coo_matrix((rows.data, (rows.row, columns)), shape=(shape[0], size)).tocsr()

    @property
    def prescribed_means(self) -> Array:
        """Mean of the prescribed values over each patch."""
        return self._groups.means(self._weights, self._given)

    @property
    def rows(self) -> list[PointHeld]:
        """The means of the patches as multi-point constraints, to find rigid motions."""
        if self._support.is_field:
            return []
        first = np.unique(self._groups.number, return_index=True)[1]
        parts = np.split(np.arange(self.means.nnz), self.means.indptr[1:-1])
        return [
            PointHeld(
                self.means.indices[mine].astype(np.int64),
                self.means.data[mine],
                0.0,
                f"{self._support}",
                (float(x[0]), float(x[1])),
            )
            for mine, x in zip(parts, self.x[first], strict=True)
        ]


def imposed(
    held: Sequence[HeldBorder], rates: Sequence[Array], mass: Array, fixed: Mask, values: Array
) -> Array:
    """Velocities after an impulse of supports on patches, as `Reduction.imposed` for the others.

    Args:
        held: The supports.
        rates: Rate of the mean of each patch of each of them [m/s].
        mass: Mass of each displacement coefficient [kg per metre depth].
        fixed: Whether other supports prescribe each of them.
        values: Velocities, or other rates, of the displacement coefficients.
    """
    of_displacement = [k for k, one in enumerate(held) if not one.support.is_field]
    if not of_displacement:
        return values
    means, weighted = _weighted([held[k] for k in of_displacement], mass, fixed)
    missing = np.concatenate([rates[k] for k in of_displacement]) - means @ values
    impulse = np.linalg.lstsq((means @ weighted).toarray(), missing, rcond=None)[0]
    return np.asarray(values + weighted @ impulse)


def work(held: Sequence[HeldBorder], mass: Array, fixed: Mask, forces: Array, u: Array) -> float:
    """Work of supports on patches, given the forces out of balance without them.

    Args:
        held, mass, fixed: As of :func:`imposed`.
        forces: On the displacement coefficients [N per metre depth]; the part that the supports cannot
            exert does no work.
        u: Increments of the displacement coefficients [m].
    """
    supports = [one for one in held if not one.support.is_field]
    if not supports:
        return 0.0
    means, weighted = _weighted(supports, mass, fixed)
    matrix = (means @ weighted).toarray()
    multipliers = np.linalg.lstsq(matrix, weighted.T @ forces, rcond=None)[0]
    return float(multipliers @ (means @ u))


def _weighted(
    held: Sequence[HeldBorder], mass: Array, fixed: Mask
) -> tuple[sp.csr_matrix, sp.csr_matrix]:
    """Means C over patches, patches x coefficients, and M^-1 C^T, 0 for fixed coefficients."""
    n = len(mass)
    means = sp.vstack([one.means[:, :n] for one in held]).tocsr()
    inverse = np.divide(1.0, mass, out=np.zeros(n), where=(mass > 0) & ~fixed)
    return means, (sp.diags(inverse) @ means.T).tocsr()
