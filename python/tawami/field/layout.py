"""Places of the coefficients of all fields, and the extraction matrix E.

The coefficients of all fields form one vector: the displacement (function, then component), followed by
the bilinear field. E gives the degrees of freedom of the mesh: nodal = E coefficients.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import numpy as np
import scipy.sparse as sp

from tawami import _rust
from tawami.base.arrays import Array, Indices, Mask
from tawami.base.space import lattice
from tawami.fem import dolfinx
from tawami.fem.mesh import FunctionSpace
from tawami.grid.basis import Basis, greville
from tawami.grid.grid import Grid


class Layout:
    """Places of the coefficients, and E.

    Args:
        grid: The grid.
        basis: Basis of the displacement.
        space: Function space on the mesh: biquadratic displacement, then a bilinear field or none.
        active: Whether each cell holds particles, on any rank, ny x nx.

    Attributes:
        num_displacement: Number of displacement coefficients; the bilinear field follows.
        size: Number of coefficients.
        active: Whether each coefficient belongs to a function with a particle in its support.
        owner: Rank of each coefficient: one with a cell in the support of the function.
        num_parts: Number of parts of the body that share no displacement function.
        part: Part of each displacement coefficient, -1 for inactive ones.
        tied: Pairs of displacement coefficients, the first of which follows the second.
    """

    def __init__(self, grid: Grid, basis: Basis, space: FunctionSpace, active: Mask) -> None:
        self.grid, self.basis, self._space = grid, basis, space
        self._bilinear = space.dofs.shape[1] > dolfinx.DISPLACEMENT_DOFS
        self._cells = np.flatnonzero(active).astype(np.uint32)
        self._of_cells = _rust.Active(grid.rust, self._cells)
        self.num_parts, part = self._of_cells.parts(basis)
        self.part = np.repeat(part, grid.space.dim)
        self.num_displacement = len(self.part)
        self.active = self._of_all(self._of_cells.functions)
        self.owner = self._of_all(lambda b: self._of_cells.spread(b, grid.rank_of_cell))
        self.size = len(self.active)
        self.tied: Indices = np.empty((0, 2), dtype=np.int64)

    def same_cells(self, other: Layout) -> bool:
        """Whether another layout has the same functions and active cells."""
        if self is other:
            return True
        same = self.grid is other.grid and self.basis == other.basis and self.size == other.size
        return same and np.array_equal(self._cells, other._cells)

    def tie(self, sums: Array, least: float) -> None:
        """Tie weak displacement functions to their strongest neighbours.

        A weak function has particles in its support, but its sum over them is below `least`.

        Args:
            sums: Sum of each function over the particles.
            least: Bound of the sums [-].
        """
        dim, shape = self.grid.space.dim, self._shape(self.basis)
        weak = np.flatnonzero(self.active[: self.num_displacement : dim] & (sums < least))
        tied: list[tuple[int, int]] = []
        for function in weak:
            at = np.unravel_index(function, shape, order="F")
            box = [np.arange(max(i - 1, 0), min(i + 2, n)) for i, n in zip(at, shape, strict=True)]
            near = lattice(box) @ np.cumprod((1, *shape[:-1]))
            strongest = near[sums[near].argmax()]
            if sums[strongest] >= least:
                tied.append((int(function), int(strongest)))
        pairs = np.array(tied, dtype=np.int64).reshape(-1, 1, 2)
        self.tied = (dim * pairs + np.arange(dim)[:, None]).reshape(-1, 2)
        self.active[self.tied[:, 0]] = False

    def _shape(self, basis: Basis) -> tuple[int, ...]:
        """Number of functions of a basis along each axis."""
        return tuple(_rust.basis_len(basis, n) for n in self.grid.cells)

    def _of_all(self, of_functions: Callable[[Basis], Any]) -> Any:
        """Values for all coefficients, from those for the functions of each field."""
        fields = [np.repeat(of_functions(self.basis), self.grid.space.dim)]
        return np.concatenate(fields + [of_functions("bilinear")] * self._bilinear)

    def reached_by(self, cells: Any) -> Mask:
        """Whether each coefficient belongs to a function with one of these cells in its support."""
        mask: Mask = self._of_all(_rust.Active(self.grid.rust, cells).functions)
        return mask

    @functools.cached_property
    def extraction(self) -> sp.csr_matrix:
        """E: degrees of freedom of this rank's cells x coefficients."""
        return self.extraction_on(np.arange(len(self._space.dofs)))

    def extraction_on(self, cells: Any) -> sp.csr_matrix:
        """The rows of E of the degrees of freedom of some dolfinx cells; the others are empty."""
        grid, of_u, of_bilinear = self.grid, dolfinx.DISPLACEMENT_DOFS, dolfinx.BILINEAR_DOFS
        dofs, dim = self._space.dofs[cells], grid.space.dim
        number = grid.cell_numbers(grid.rectangle.ij[cells])
        fields: list[tuple[Basis, int, Any]] = [(self.basis, 2, dofs[:, :of_u].reshape(-1, dim))]
        if self._bilinear:
            fields.append(("bilinear", 1, dofs[:, of_u : of_u + of_bilinear].reshape(-1, 1)))
        rows, columns, values, first = [], [], [], 0
        for basis, degree, of_nodes in fields:
            functions, at_nodes = self._at_nodes(basis, degree, number)
            once = np.unique(of_nodes[:, 0], return_index=True)[1]  # (cell, node) of each row
            functions = functions[once // at_nodes.shape[1]]
            at_nodes = at_nodes.reshape(-1, at_nodes.shape[2])[once]
            components = np.arange(of_nodes.shape[1])
            shape = (*functions.shape, len(components))
            columns.append(first + len(components) * functions[..., None] + components)
            rows.append(np.broadcast_to(of_nodes[once][:, None], shape))
            values.append(np.broadcast_to(at_nodes[..., None], shape))
            first += len(components) * int(np.prod(self._shape(basis)))
        flat = [
            np.concatenate([part.ravel() for part in parts]) for parts in (values, rows, columns)
        ]
        matrix = sp.csr_matrix((flat[0], (flat[1], flat[2])), shape=(self._space.size, self.size))
        matrix.eliminate_zeros()
        return matrix

    def on_cell(self, cell: Indices) -> tuple[Indices, Array]:
        """Coefficients on a cell (i, j), and T: degrees of freedom of a kernel = T coefficients."""
        number, dim = np.array([self.grid.cell_numbers(cell)]), self.grid.space.dim
        functions, at_nodes = self._at_nodes(self.basis, 2, number)
        coefficients = (dim * functions[0][:, None] + np.arange(dim)).ravel()
        blocks = [np.kron(at_nodes[0], np.eye(dim))]
        if self._bilinear:  # each function is 1 at one vertex
            functions, at_nodes = self._at_nodes("bilinear", 1, number)
            of_vertices = self.num_displacement + functions[0][at_nodes[0].argmax(axis=1)]
            coefficients = np.concatenate([coefficients, of_vertices])
            blocks.append(np.eye(len(of_vertices)))
        return coefficients, sp.block_diag(blocks).toarray()

    def _at_nodes(self, basis: Basis, degree: int, cells: Indices) -> tuple[Indices, Array]:
        """Functions on cells (cells x functions), and their values at Lagrange nodes of a degree
        (cells x nodes x functions).
        """
        nodes = self.grid.rectangle.to_grid_axes(dolfinx.reference_nodes(degree))
        return _rust.extraction(basis, self.grid.cells, cells, np.ascontiguousarray(nodes))

    @property
    def greville(self) -> Array:
        """Greville points [m] of the displacement functions, functions x components."""
        return greville(self.basis, self.grid.origin, self.grid.h, self.grid.cells)

    def split(self, coefficients: Array) -> tuple[Array, Array | None]:
        """Coefficients of the displacement and of the bilinear field (None if there is none)."""
        n = self.num_displacement
        return coefficients[:n], coefficients[n:] if n < self.size else None

    def cells_of(self, coefficient: int) -> Indices:
        """Cells (i, j) with particles in the support of a coefficient's function, cells x axes."""
        if coefficient < self.num_displacement:
            return self._of_cells.support(self.basis, coefficient // self.grid.space.dim)
        return self._of_cells.support("bilinear", coefficient - self.num_displacement)
