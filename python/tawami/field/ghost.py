"""Ghost penalty: what a form adds on the sides that partly filled cells share with others.

A cell is partly filled where one of its eight neighbours in the grid holds no particles. The term is
linear in the fields, so that it is one matrix from one reset of the grid to the next; FFCx' kernel of
the side gives it for both cells at once. (Burman 2010.)
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from tawami import _rust
from tawami.base import ranks
from tawami.fem import dolfinx
from tawami.fem.kernels import Kernel
from tawami.field.reduction import Layout
from tawami.form.compilation import Integral
from tawami.grid.grid import Grid

Array = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]
Side = tuple[tuple[int, int], tuple[int, int], tuple[str, str]]


def partly_filled(active: Mask) -> Mask:
    """Cells with particles that have a neighbour without, ny x nx."""
    ny, nx = active.shape
    padded = np.pad(active, 1, constant_values=True)
    shifts = [(i, j) for i in range(3) for j in range(3)]
    filled = np.logical_and.reduce([padded[j : j + ny, i : i + nx] for i, j in shifts])
    return np.asarray(active & ~filled)


def sides(active: Mask) -> Iterator[Side]:
    """Cells (i, j) on both sides, and names of the side as each of them has it."""
    partly = partly_filled(active)
    for (di, dj), names in (((1, 0), ("right", "left")), ((0, 1), ("top", "bottom"))):
        ny, nx = active.shape
        here, there = (slice(0, ny - dj), slice(0, nx - di)), (slice(dj, None), slice(di, None))
        both = active[here] & active[there] & (partly[here] | partly[there])
        for j, i in np.argwhere(both):
            yield (int(i), int(j)), (int(i) + di, int(j) + dj), names


def matrix(
    grid: Grid,
    layout: Layout,
    integral: Integral,
    active: Mask,
    location: _rust.Location,
    volume: Array,
    data: Array,
    values: Mapping[str, float],
) -> sp.csr_matrix:
    """Matrix on all coefficients, the same on every rank.

    Args:
        grid: The grid.
        layout: Where the coefficients stand.
        integral: The compiled term.
        active: Whether each cell holds particles, ny x nx.
        location: Where this rank's particles are.
        volume: Their volumes [m2].
        data: What is averaged over the cells, particles x columns.
        values: Numbers that the form names.
    """
    mean = _means(grid, location, volume, data)
    columns = list(integral.slots[0].columns) if integral.slots else []
    constants = np.array([values[name] for name in integral.constants], dtype=float)
    kernel = _call(integral.kernel)
    to_grid = grid.rectangle.to_grid_axes
    vertices = grid.h * np.pad(to_grid(dolfinx.reference_nodes(1)), ((0, 0), (0, 1)))
    rows, cols, entries = [], [], []
    for here, there, names in sides(active):
        shift = grid.h * np.array([*np.subtract(there, here), 0])
        x = np.concatenate([vertices, vertices + shift]).ravel()
        facets = np.array([grid.rectangle.facet_of_edge(name) for name in names], dtype=np.int32)
        cells = [i + grid.cells[0] * j for i, j in (here, there)]
        packed = mean[cells][:, columns].ravel()
        (c0, t0), (c1, t1) = (_extraction(grid, layout, cell) for cell in (here, there))
        element = np.zeros((2 * len(t0), 2 * len(t0)))
        kernel(element, packed, constants, x, facets)
        coefficients = np.concatenate([c0, c1])
        t = sp.block_diag([t0, t1]).toarray()
        reduced = t.T @ element @ t
        rows.append(np.repeat(coefficients, len(coefficients)))
        cols.append(np.tile(coefficients, len(coefficients)))
        entries.append(reduced.ravel())
    shape = (layout.size, layout.size)
    if not rows:
        return sp.csr_matrix(shape)
    index = (np.concatenate(rows), np.concatenate(cols))
    return sp.csr_matrix((np.concatenate(entries), index), shape=shape)


def _extraction(
    grid: Grid, layout: Layout, cell: tuple[int, int]
) -> tuple[npt.NDArray[Any], Array]:
    """Coefficients on a cell, and T: the kernel's degrees of freedom there = T coefficients."""
    nodes = grid.rectangle.to_grid_axes(dolfinx.reference_nodes(2))
    functions, values = [], []
    for axis in range(2):
        n, number = grid.cells[axis], np.full(len(nodes), cell[axis])
        first, at_nodes = _rust.basis_1d(layout.basis, n, number, nodes[:, axis].copy())
        used = at_nodes.any(axis=0)
        functions.append(first[0] + np.flatnonzero(used))
        values.append(at_nodes[:, used])
    width = _rust.basis_len(layout.basis, grid.cells[0])
    function = (functions[0] + width * functions[1][:, None]).ravel()
    scalar = (values[1][:, :, None] * values[0][:, None, :]).reshape(len(nodes), -1)
    coefficients = (2 * function[:, None] + np.arange(2)).ravel()
    t = np.kron(scalar, np.eye(2))
    if layout.size > layout.num_displacement:
        vertices = np.rint(grid.rectangle.to_grid_axes(dolfinx.reference_nodes(1))).astype(int)
        i, j = (np.array(cell) + vertices).T
        more = layout.num_displacement + i + (grid.cells[0] + 1) * j
        coefficients = np.concatenate([coefficients, more])
        t = sp.block_diag([t, np.eye(4)]).toarray()
    return coefficients, t


def _means(grid: Grid, location: _rust.Location, volume: Array, data: Array) -> Array:
    """Means over the particles of each cell, on whichever rank: cells x columns."""
    cells = grid.cells[0] * grid.cells[1]
    columns = [volume, *(volume[:, None] * data).T]
    sums = np.stack(
        [np.bincount(location.cell, weights=column, minlength=cells) for column in columns], axis=1
    )
    sums = ranks.sum_of(grid.comm, sums)
    return np.asarray(sums[:, 1:] / np.where(sums[:, :1] > 0, sums[:, :1], 1.0))


def _call(kernel: Kernel) -> Callable[..., None]:
    """An FFCx kernel of two cells, as a function of arrays."""
    function = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 7)(kernel.address)
    same_way = np.zeros(2, dtype=np.uint8)  # both cells run along the side in the same direction

    def call(element: Array, packed: Array, constants: Array, x: Array, facets: Any) -> None:
        arrays = (element, packed, constants, x, facets, same_way)
        function(*(array.ctypes.data for array in arrays), None)

    return call
