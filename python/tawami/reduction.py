"""fields = P unknowns + g: extraction, supports, point constraints, inactive functions in one P.

Coefficients of all fields stand in one vector: the displacement (function, then component), then
the bilinear field. `nodal = E coefficients` are the degrees of freedom of the mesh, `coefficients =
S unknowns + offset` are what supports leave free, P = E S.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from tawami import _dolfinx, _rust
from tawami.basis import Basis, extraction, greville_1d, values_1d
from tawami.boundary import Held, PointHeld
from tawami.errors import SupportError
from tawami.grid import Grid

Array = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]
Indices = npt.NDArray[np.int64]


class Layout:
    """Where the coefficients of the fields stand, and E.

    Args:
        grid: The grid.
        basis: Basis of the displacement.
        space: Function space on the mesh: biquadratic displacement, then a bilinear field or none.
        active: Whether each cell holds particles, ny x nx.

    Attributes:
        num_displacement: Number of displacement coefficients; the bilinear field's follow.
        size: Number of coefficients.
        extraction: E, degrees of freedom of the mesh x coefficients.
        active: Whether each coefficient belongs to a function with a particle in its support.
        num_parts: Number of parts of the body that share no displacement function.
        part: Part that each displacement coefficient belongs to, -1 for inactive ones.
    """

    def __init__(self, grid: Grid, basis: Basis, space: _dolfinx.Space, active: Mask) -> None:
        self.grid, self.basis = grid, basis
        of_u, of_bilinear = _dolfinx.DISPLACEMENT_DOFS, _dolfinx.BILINEAR_DOFS
        blocks = [_place(grid, space, np.arange(of_u).reshape(-1, 2), basis, degree=2)]
        functions = _functions_of_cells(basis, grid.cells, active)
        count = blocks[0].shape[1] // 2
        masks = [np.repeat(_mask(functions, count), 2)]
        self.num_parts, self.part = _parts(functions, count)
        self._cells = np.argwhere(active)[:, ::-1]
        self._functions = [functions]
        if space.dofs.shape[1] > of_u:
            local = of_u + np.arange(of_bilinear)[:, None]
            blocks.append(_place(grid, space, local, "bilinear", degree=1))
            functions = _functions_of_cells("bilinear", grid.cells, active)
            masks.append(_mask(functions, blocks[1].shape[1]))
            self._functions.append(functions)
        self.extraction = sp.hstack(blocks, format="csr")
        self.num_displacement = blocks[0].shape[1]
        self.size = self.extraction.shape[1]
        self.active = np.concatenate(masks)

    def split(self, coefficients: Array) -> tuple[Array, Array | None]:
        """Coefficients of the displacement and of the bilinear field (None if there is none)."""
        n = self.num_displacement
        return coefficients[:n], coefficients[n:] if n < self.size else None

    def cells_of(self, coefficient: int) -> Indices:
        """The cells (i, j) with particles in the support of a coefficient's function."""
        displacement = coefficient < self.num_displacement
        function = coefficient // 2 if displacement else coefficient - self.num_displacement
        functions = self._functions[0 if displacement else 1]
        cells: Indices = self._cells[(functions == function).any(axis=1)]
        return cells

    def rigid_modes(self, part: Mask) -> tuple[Array, Array, float]:
        """Coefficients of the translations in x and y and of the rotation (coefficients x 3), the
        centre [m] of a part of the body and the length [m] that scales the rotation to order 1.
        """
        grid = self.grid
        x, y = (
            grid.origin[axis] + grid.h * greville_1d(self.basis, grid.cells[axis])
            for axis in range(2)
        )
        points = np.stack([np.tile(x, len(y)), np.repeat(y, len(x))], axis=1)
        mine = points[part[::2]]
        centre = mine.mean(axis=0)
        length = float(np.ptp(mine, axis=0).max())
        modes = np.zeros((self.num_displacement, 3))
        modes[0::2, 0] = modes[1::2, 1] = 1.0
        modes[0::2, 2] = -(points[:, 1] - centre[1]) / length
        modes[1::2, 2] = (points[:, 0] - centre[0]) / length
        return modes, centre, length


def _place(
    grid: Grid, space: _dolfinx.Space, local: Indices, basis: Basis, *, degree: int
) -> sp.csr_matrix:
    """E of one field, its rows moved to the degrees of freedom of the mesh.

    Args:
        grid: The grid.
        space: Space of all fields.
        local: Position in a cell of the degree of freedom of each node and component.
        basis: Basis of the field.
        degree: Degree of its Lagrange nodes on the mesh.
    """
    scalar = extraction(basis, grid.cells, degree).tocoo()
    num_nodes, num_functions = scalar.shape
    components = local.shape[1]
    nodes = np.rint(degree * grid.rectangle.to_grid_axes(_dolfinx.reference_nodes(degree)))
    i, j = (degree * grid.rectangle.ij[:, axis, None] + nodes[:, axis] for axis in range(2))
    node = (i + (degree * grid.cells[0] + 1) * j).astype(np.int64)
    dof = np.empty((num_nodes, components), dtype=np.int64)
    dof[node] = space.dofs[:, local]
    rows = dof[scalar.row].ravel()
    columns = (components * scalar.col[:, None].astype(np.int64) + np.arange(components)).ravel()
    shape = (space.size, components * num_functions)
    return sp.csr_matrix((np.repeat(scalar.data, components), (rows, columns)), shape=shape)


def _functions_of_cells(basis: Basis, cells: tuple[int, int], active: Mask) -> Indices:
    """Functions that do not vanish in each active cell, active cells x functions."""
    j, i = np.nonzero(active)
    fx, fy = (
        values_1d(basis, n, cell, np.full(len(cell), 0.4)).indices.reshape(len(cell), -1)
        for n, cell in zip(cells, (i, j), strict=True)
    )
    width = _rust.basis_len(basis, cells[0])
    functions: Indices = fx[:, None, :] + width * fy[:, :, None].astype(np.int64)
    return functions.reshape(len(i), -1)


def _parts(functions: Indices, count: int) -> tuple[int, Indices]:
    """Parts of the body that share no displacement function: their number, and the part of each
    displacement coefficient (-1 for inactive ones).
    """
    cell = np.repeat(np.arange(len(functions)), functions.shape[1])
    shape = (len(functions), count)
    incidence = sp.csr_matrix((np.ones(functions.size), (cell, functions.ravel())), shape=shape)
    number, of_cell = connected_components(incidence @ incidence.T, directed=False)
    part = np.full(count, -1)
    part[functions] = of_cell[:, None]
    return int(number), np.repeat(part, 2)


def _mask(functions: Indices, count: int) -> Mask:
    mask = np.zeros(count, dtype=bool)
    mask[functions] = True
    return mask


class Reduction:
    """What the supports leave free.

    Args:
        layout: The coefficients.
        held: Coefficients with their prescribed values.
        points: Multi-point constraints with their prescribed values.
        start: Coefficients that are there already; values are prescribed for the sum of these and
            the increments, unknowns are increments.

    Attributes:
        size: Number of unknowns.
        unknowns: Coefficient that each unknown is.
        selection: S, coefficients x unknowns.
        offset: Increments of the coefficients at zero unknowns.

    Raises:
        SupportError: Supports that contradict each other, or that leave a rigid motion free.
    """

    def __init__(
        self, layout: Layout, held: Sequence[Held], points: Sequence[PointHeld], start: Array
    ) -> None:
        self.layout = layout
        total = np.zeros(layout.size)
        fixed = np.zeros(layout.size, dtype=bool)
        sizes = [float(np.abs(support.values).max(initial=0.0)) for support in held]
        sizes += [abs(point.value) for point in points]
        tolerance = 1e-9 * max(sizes, default=0.0)  # where supports meet: round-off
        for support in held:
            _hold(support, fixed, total, tolerance)
        _check_rigid_motions(layout, fixed, points)
        dependent, involved, weights, values = _eliminate(points, fixed, total, start, tolerance)
        free = layout.active & ~fixed
        free[dependent] = False
        self.unknowns = np.flatnonzero(free)
        self.size = len(self.unknowns)
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
