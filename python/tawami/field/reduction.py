"""fields = P unknowns + g: extraction, supports, point constraints, inactive functions in one P.

Coefficients of all fields stand in one vector: the displacement (function, then component), then
the bilinear field. `nodal = E coefficients` are the degrees of freedom of the mesh, `coefficients =
S unknowns + offset` are what supports leave free, P = E S.
"""

from __future__ import annotations

import functools
import hashlib
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from scipy.sparse.linalg import spsolve

from tawami import _rust
from tawami.base.errors import SupportError
from tawami.fem import dolfinx
from tawami.fem.mesh import FunctionSpace
from tawami.grid.basis import Basis, greville_1d
from tawami.grid.edges import Held, PointHeld
from tawami.grid.grid import Grid

Array = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]
Indices = npt.NDArray[np.int64]


class Layout:
    """Where the coefficients of the fields stand, and E.

    Args:
        grid: The grid.
        basis: Basis of the displacement.
        space: Function space on the mesh: biquadratic displacement, then a bilinear field or none.
        active: Whether each cell holds particles, on whichever rank, ny x nx.

    Attributes:
        num_displacement: Number of displacement coefficients; the bilinear field's follow.
        size: Number of coefficients.
        active: Whether each coefficient belongs to a function with a particle in its support.
        owner: The rank that keeps each coefficient's row: one with a cell of its support.
        num_parts: Number of parts of the body that share no displacement function.
        part: Part that each displacement coefficient belongs to, -1 for inactive ones.
        tied: Displacement coefficients that follow others, with these: pairs.
    """

    def __init__(self, grid: Grid, basis: Basis, space: FunctionSpace, active: Mask) -> None:
        self.grid, self.basis, self._space = grid, basis, space
        self._bilinear = space.dofs.shape[1] > dolfinx.DISPLACEMENT_DOFS
        self._of_cells = _rust.Active(grid.rust, np.flatnonzero(active).astype(np.uint32))
        self.num_parts, part = self._of_cells.parts(basis)
        self.part = np.repeat(part, 2)
        self.num_displacement = len(self.part)
        self.active = self._of_all(self._of_cells.functions)
        self.owner = self._of_all(lambda b: self._of_cells.spread(b, grid.rank_of_cell))
        self.size = len(self.active)
        self.tied: Indices = np.empty((0, 2), dtype=np.int64)

    def tie(self, sums: Array, least: float) -> None:
        """Let displacement functions with particles in their support, but with a sum over these below
        `least`, follow the neighbour with the largest sum.
        """
        n = self.num_displacement
        weak = np.flatnonzero(self.active[:n:2] & (sums < least))
        width, height = (_rust.basis_len(self.basis, cells) for cells in self.grid.cells)
        tied: list[tuple[int, int]] = []
        for function in weak:
            i, j = int(function) % width, int(function) // width
            near = [
                p + width * q
                for q in range(max(j - 1, 0), min(j + 2, height))
                for p in range(max(i - 1, 0), min(i + 2, width))
            ]
            strongest = max(near, key=lambda f: float(sums[f]))
            if sums[strongest] >= least:
                tied.append((int(function), strongest))
        pairs = np.array(tied, dtype=np.int64).reshape(-1, 1, 2)
        self.tied = (2 * pairs + np.arange(2)[:, None]).reshape(-1, 2)
        self.active[self.tied[:, 0]] = False

    def _of_all(self, of_functions: Callable[[Basis], Any]) -> Any:
        """Values for all coefficients from those for the functions of each field."""
        fields = [np.repeat(of_functions(self.basis), 2)]
        return np.concatenate(fields + [of_functions("bilinear")] * self._bilinear)

    def reached_by(self, cells: npt.NDArray[np.uint32]) -> Mask:
        """Whether each coefficient belongs to a function with one of these cells in its support."""
        mask: Mask = self._of_all(_rust.Active(self.grid.rust, cells).functions)
        return mask

    @functools.cached_property
    def extraction(self) -> sp.csr_matrix:
        """E: degrees of freedom that this rank's cells have on the mesh x coefficients."""
        return self.extraction_on(np.arange(len(self._space.dofs)))

    def extraction_on(self, cells: npt.NDArray[Any]) -> sp.csr_matrix:
        """The rows of E of the degrees of freedom of some of this rank's dolfinx cells; the others
        are empty.
        """
        of_u, of_bilinear = dolfinx.DISPLACEMENT_DOFS, dolfinx.BILINEAR_DOFS
        dofs = self._space.dofs[cells]
        fields: list[tuple[Basis, int, Any]] = [(self.basis, 2, dofs[:, :of_u].reshape(-1, 2))]
        if self._bilinear:
            fields.append(("bilinear", 1, dofs[:, of_u : of_u + of_bilinear].reshape(-1, 1)))
        rows, columns, values, first = [], [], [], 0
        for basis, degree, of_nodes in fields:
            functions, weights, count = self._at_nodes(basis, degree, cells)
            once = np.unique(of_nodes[:, 0], return_index=True)[1]
            components = np.arange(of_nodes.shape[1])
            shape = (len(once), functions.shape[1], len(components))
            columns.append(first + len(components) * functions[once][..., None] + components)
            rows.append(np.broadcast_to(of_nodes[once][:, None], shape))
            values.append(np.broadcast_to(weights[once][..., None], shape))
            first += len(components) * count
        flat = [
            np.concatenate([part.ravel() for part in parts]) for parts in (values, rows, columns)
        ]
        matrix = sp.csr_matrix((flat[0], (flat[1], flat[2])), shape=(self._space.size, self.size))
        matrix.eliminate_zeros()
        return matrix

    def _at_nodes(self, basis: Basis, degree: int, cells: Any) -> tuple[Indices, Array, int]:
        """Functions at the Lagrange nodes of cells and their values there (nodes x functions, cell
        by cell), and how many functions the basis has.
        """
        grid = self.grid
        nodes = grid.rectangle.to_grid_axes(dolfinx.reference_nodes(degree))
        along = []
        for axis, n in enumerate(grid.cells):
            cell = np.repeat(grid.rectangle.ij[cells, axis], len(nodes))
            first, values = _rust.basis_1d(basis, n, cell, np.tile(nodes[:, axis], len(cells)))
            along.append((first[:, None] + np.arange(3), values))
        (fx, vx), (fy, vy) = along
        width, height = (_rust.basis_len(basis, n) for n in grid.cells)
        functions = fx[:, None, :] + width * fy[:, :, None]
        weights = vx[:, None, :] * vy[:, :, None]
        # a function beyond the last has the value 0 (a bilinear cell has two along each axis)
        functions = np.where(weights == 0, 0, functions)
        return functions.reshape(-1, 9), weights.reshape(-1, 9), width * height

    @functools.cached_property
    def greville(self) -> Array:
        """Greville points [m] of the displacement functions, functions x 2."""
        grid = self.grid
        x, y = (
            grid.origin[axis] + grid.h * greville_1d(self.basis, grid.cells[axis])
            for axis in range(2)
        )
        return np.stack([np.tile(x, len(y)), np.repeat(y, len(x))], axis=1)

    def split(self, coefficients: Array) -> tuple[Array, Array | None]:
        """Coefficients of the displacement and of the bilinear field (None if there is none)."""
        n = self.num_displacement
        return coefficients[:n], coefficients[n:] if n < self.size else None

    def cells_of(self, coefficient: int) -> Indices:
        """The cells (i, j) with particles in the support of a coefficient's function."""
        displacement = coefficient < self.num_displacement
        function = coefficient // 2 if displacement else coefficient - self.num_displacement
        basis: Basis = self.basis if displacement else "bilinear"
        return self._of_cells.support(basis, function)

    def rigid_modes(self, part: Mask) -> tuple[Array, Array, float]:
        """Coefficients of the translations in x and y and of the rotation (coefficients x 3), the
        centre [m] of a part of the body and the length [m] that scales the rotation to order 1.
        """
        points = self.greville
        mine = points[part[::2]]
        centre = mine.mean(axis=0)
        length = float(np.ptp(mine, axis=0).max())
        modes = np.zeros((self.num_displacement, 3))
        modes[0::2, 0] = modes[1::2, 1] = 1.0
        modes[0::2, 2] = -(points[:, 1] - centre[1]) / length
        modes[1::2, 2] = (points[:, 0] - centre[0]) / length
        return modes, centre, length


class Reduction:
    """What the supports leave free.

    Args:
        layout: The coefficients.
        held: Coefficients with their prescribed values.
        points: Multi-point constraints with their prescribed values.
        start: Coefficients that are there already; values are prescribed for the sum of these and
            the increments, unknowns are increments.
        moving: Rigid motions may be free: inertia holds the body.

    Attributes:
        size: Number of unknowns.
        unknowns: Coefficient that each unknown is; those of a rank follow those of the one before.
        own: The unknowns whose rows this rank keeps.
        selection: S, coefficients x unknowns.
        offset: Increments of the coefficients at zero unknowns.
        fixed: Whether each coefficient is prescribed by itself, along an edge.
        points: The multi-point constraints.

    Raises:
        SupportError: Supports that contradict each other, or that leave a rigid motion free.
    """

    def __init__(
        self,
        layout: Layout,
        held: Sequence[Held],
        points: Sequence[PointHeld],
        start: Array,
        *,
        moving: bool = False,
    ) -> None:
        self.layout = layout
        self.points = points
        total = np.zeros(layout.size)
        self.fixed = fixed = np.zeros(layout.size, dtype=bool)
        sizes = [float(np.abs(support.values).max(initial=0.0)) for support in held]
        sizes += [abs(point.value) for point in points]
        tolerance = 1e-9 * max(sizes, default=0.0)  # where supports meet: round-off
        for support in held:
            _hold(support, fixed, total, tolerance)
        if not moving:
            _check_rigid_motions(layout, fixed, points)
        dependent, involved, weights, values = _eliminate(points, fixed, total, start, tolerance)
        free = layout.active & ~fixed
        free[dependent] = False
        self._number(free)
        number = np.full(layout.size, -1)
        number[self.unknowns] = np.arange(self.size)
        row, column = np.nonzero(weights)
        entries = np.concatenate([np.ones(self.size), -weights[row, column]])
        rows = np.concatenate([self.unknowns, dependent[row]])
        columns = np.concatenate([np.arange(self.size), number[involved[column]]])
        shape = (layout.size, self.size)
        self.selection = sp.csr_matrix((entries, (rows, columns)), shape=shape)
        self.offset = np.where(fixed, total - start, 0.0)
        self.offset[dependent] = values
        follows = layout.tied[~fixed[layout.tied[:, 0]]]
        if len(follows):
            followers, leaders = follows.T
            swap = sp.csr_matrix(
                (np.ones(len(follows)), (followers, leaders)), shape=(layout.size,) * 2
            )
            self.selection = sp.csr_matrix(self.selection + swap @ self.selection)
            self.offset[followers] = self.offset[leaders]

    @classmethod
    def of_all(cls, layout: Layout) -> Reduction:
        """Every coefficient is an unknown, those of inactive functions too."""
        reduction = cls.__new__(cls)
        reduction.layout, reduction.points = layout, []
        reduction.fixed = np.zeros(layout.size, dtype=bool)
        reduction._number(np.ones(layout.size, dtype=bool))
        entries = (np.ones(layout.size), (reduction.unknowns, np.arange(layout.size)))
        reduction.selection = sp.csr_matrix(entries, shape=(layout.size, layout.size))
        reduction.offset = np.zeros(layout.size)
        return reduction

    def imposed(self, values: Array, mass: Array, offset: Array) -> Array:
        """The displacement field nearest to another one, in the norm of the lumped mass, that obeys the
        supports: what an impulse of theirs makes of velocities.

        Args:
            values: Of all displacement coefficients.
            mass: Of these [kg per metre depth].
            offset: As `offset`, for the rate that `values` are.
        """
        n = len(values)
        free = self.unknowns < n
        s, g = self.selection[:n][:, free], offset[:n]
        if not self.points and not len(self.layout.tied):
            return np.asarray(s @ (values - g)[self.unknowns[free]] + g)
        weighted = s.T @ sp.diags(mass)
        return np.asarray(s @ spsolve((weighted @ s).tocsc(), weighted @ (values - g)) + g)

    def _number(self, free: Mask) -> None:
        comm, unknowns = self.layout.grid.comm, np.flatnonzero(free)
        owner = self.layout.owner[unknowns]
        self.unknowns = unknowns[np.argsort(owner, kind="stable")]
        self.size = len(unknowns)
        ends = np.cumsum(np.bincount(owner, minlength=comm.size))
        self.own = slice(int(ends[comm.rank - 1]) if comm.rank else 0, int(ends[comm.rank]))

    @property
    def digest(self) -> str:
        """The same for reductions with the same unknowns and S."""
        s = self.selection
        parts = (self.unknowns, s.indptr, s.indices, s.data)
        return hashlib.sha1(b"".join(np.ascontiguousarray(a).tobytes() for a in parts)).hexdigest()

    def same_unknowns(self, other: Reduction | None) -> bool:
        """Whether another reduction has the same unknowns and S, so that matrices are alike."""
        if other is None or other.layout is not self.layout or other.size != self.size:
            return False
        mine, others = self.selection, other.selection
        return (
            np.array_equal(self.unknowns, other.unknowns)
            and np.array_equal(mine.indptr, others.indptr)
            and np.array_equal(mine.indices, others.indices)
            and np.array_equal(mine.data, others.data)
        )


def _hold(support: Held, fixed: Mask, total: Array, tolerance: float) -> None:
    twice = fixed[support.indices]
    change = np.abs(total[support.indices] - support.values)[twice].max(initial=0.0)
    if change > tolerance:
        raise SupportError(
            f"two supports prescribe displacements that differ by {change:.3g} m where they meet (an "
            "end of an edge?): expected supports that agree there. Profiles are projected in L2, "
            "which may miss their values at an end by the error of the projection"
        )
    total[support.indices] = support.values
    fixed[support.indices] = True


def _eliminate(
    points: Sequence[PointHeld], fixed: Mask, total: Array, start: Array, tolerance: float
) -> tuple[Indices, Indices, Array, Array]:
    """Solve the multi-point constraints for one coefficient each (the one with the largest weight).

    Returns:
        The dependent coefficients, the others involved, and A, b with the increments
        `c[dependent] = b - A c[others]`.
    """
    all_indices = [point.indices for point in points]
    involved = np.unique(np.concatenate([*all_indices, np.empty(0, dtype=np.int64)]))
    involved = involved[~fixed[involved]]
    a = np.zeros((len(points), len(involved)))
    b = np.zeros(len(points))
    for k, point in enumerate(points):
        loose = ~fixed[point.indices]
        a[k, np.searchsorted(involved, point.indices[loose])] = point.weights[loose]
        known = np.where(loose, start[point.indices], total[point.indices])
        b[k] = point.value - point.weights @ known
    pivots: dict[int, int] = {}
    for k, point in enumerate(points):
        pivot = int(np.argmax(np.abs(a[k]))) if len(involved) else -1
        if pivot < 0 or abs(a[k, pivot]) < 1e-10:
            if abs(b[k]) > tolerance:
                raise SupportError(
                    f"{point.where}: other supports already give this point a displacement that "
                    f"differs by {abs(b[k]):.3g} m; expected supports that agree, or one of them"
                )
            continue
        b[k] /= a[k, pivot]
        a[k] /= a[k, pivot]
        for other in set(range(len(points))) - {k}:
            b[other] -= a[other, pivot] * b[k]
            a[other] -= a[other, pivot] * a[k]
        pivots[k] = pivot
    rows, columns = list(pivots), list(pivots.values())
    others = np.setdiff1d(np.arange(len(involved)), columns)
    return involved[columns].astype(np.int64), involved[others], a[rows][:, others], b[rows]


def _check_rigid_motions(layout: Layout, fixed: Mask, points: Sequence[PointHeld]) -> None:
    """Name the rigid motions of each separate part of the body that no support prevents."""
    for number in range(layout.num_parts):
        mine = layout.part == number
        modes, centre, length = layout.rigid_modes(mine)
        held = modes[mine & fixed[: layout.num_displacement]]
        rows = [p.weights @ modes[p.indices] for p in points if mine[p.indices].any()]
        matrix = np.vstack([held.T @ held, *rows, np.zeros((3, 3))])
        _, singular, vectors = np.linalg.svd(matrix)
        free = vectors[singular < 1e-10 * max(singular[0], 1e-300)]
        if not len(free):
            continue
        what = "the body"
        if layout.num_parts > 1:
            what = (
                f"the part of the body around ({centre[0]:.3g}, {centre[1]:.3g}), which shares no "
                f"function with the others ({layout.num_parts} parts),"
            )
        raise SupportError(
            f"the supports leave {what} free to move: {', '.join(_names(free, centre, length))}. "
            "A static scene needs supports that prevent it: add scene.fix(...) or scene.hold(...)"
        )


def _names(free: Array, centre: Array, length: float) -> list[str]:
    """Words for the rigid motions spanned by the rows (translation x, y, rotation)."""
    names, rest = [], free
    for axis, name in enumerate("xy"):
        unit = np.eye(3)[axis]
        if np.linalg.norm(free @ unit) > 1 - 1e-8:
            names.append(f"translation in {name}")
            rest = rest - np.outer(rest @ unit, unit)
    _, singular, vectors = np.linalg.svd(rest)
    for motion in vectors[: len(singular)][singular > 1e-8]:
        if abs(motion[2]) < 1e-8:
            names.append(f"translation along ({motion[0]:.3g}, {motion[1]:.3g})")
        else:
            # u = a + w (-(y - yc), x - xc) / L vanishes at this point
            x, y = centre + length * np.array([-motion[1], motion[0]]) / motion[2]
            names.append(f"rotation about ({x:.3g}, {y:.3g})")
    return names
