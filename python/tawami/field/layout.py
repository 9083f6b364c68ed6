"""Places of the coefficients of all fields, and the extraction matrix E.

The coefficients of all fields form one vector, in the order of the form: the displacement first. Those
of a field go function by function and component by component. E gives the degrees of freedom of the
mesh: nodal = E coefficients.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
import scipy.sparse as sp

from tawami import _rust
from tawami.base.arrays import Array, Indices, Mask
from tawami.base.space import lattice
from tawami.fem import dolfinx
from tawami.fem.mesh import FunctionSpace
from tawami.form.fields import Field
from tawami.grid.basis import Basis, greville
from tawami.grid.grid import Grid


@dataclass(frozen=True)
class Place:
    """Place of a field among the coefficients.

    Attributes:
        basis: Its functions.
        components: Number of components of each function.
        degree: Degree along each axis of its element on the mesh.
        start: Its first coefficient.
        num_functions: Number of its functions.
    """

    basis: Basis
    components: int
    degree: int
    start: int
    num_functions: int

    @property
    def stop(self) -> int:
        """The coefficient after its last one."""
        return self.start + self.components * self.num_functions

    @property
    def slice(self) -> slice:
        """All of its coefficients."""
        return slice(self.start, self.stop)

    def holds(self, coefficients: Any) -> Any:
        """Whether numbers of coefficients are those of this field."""
        return (coefficients >= self.start) & (coefficients < self.stop)


class Layout:
    """Places of the coefficients, and E.

    Args:
        grid: The grid.
        basis: Basis of the displacement.
        fields: The fields of the form; the displacement comes first.
        space: Their function space on the mesh.
        active: Whether each cell holds particles, on any rank, ny x nx.

    Attributes:
        fields: Place of each field by name.
        volumetric: Place of the volumetric strain or pressure; None without such a field.
        num_displacement: Number of displacement coefficients; the other fields follow.
        size: Number of coefficients.
        active: Whether each coefficient belongs to a function with a particle in its support.
        owner: Rank of each coefficient: one with a cell in the support of the function.
        num_parts: Number of parts of the body that share no displacement function.
        part: Part of each displacement coefficient, -1 for inactive ones.
        tied: Pairs of coefficients, the first of which follows the second.
    """

    def __init__(
        self,
        grid: Grid,
        basis: Basis,
        fields: Mapping[str, Field],
        space: FunctionSpace,
        active: Mask,
    ) -> None:
        self.grid, self.basis, self._space = grid, basis, space
        self.fields: dict[str, Place] = {}
        self.size = 0
        for name, field in fields.items():
            its_basis = cast(Basis, field.basis or basis)
            count = int(np.prod(self._shape(its_basis)))
            place = Place(its_basis, field.components, field.degree, self.size, count)
            self.fields[name], self.size = place, place.stop
        roles = {field.role: self.fields[name] for name, field in fields.items()}
        self.volumetric = roles.get("volumetric_strain", roles.get("pressure"))
        self._cells = np.flatnonzero(active).astype(np.uint32)
        self._of_cells = _rust.Active(grid.rust, self._cells)
        self.num_parts, part = self._of_cells.parts(basis)
        self.part = np.repeat(part, grid.space.dim)
        self.num_displacement = len(self.part)
        self.active = self._of_all(self._of_cells.functions)
        self.owner = self._of_all(lambda b: self._of_cells.spread(b, grid.rank_of_cell))
        self.tied: Indices = np.empty((0, 2), dtype=np.int64)

    def same_cells(self, other: Layout) -> bool:
        """Whether another layout has the same functions and active cells."""
        if self is other:
            return True
        same = self.grid is other.grid and self.fields == other.fields
        return same and np.array_equal(self._cells, other._cells)

    def tie(self, names: Sequence[str], sums: Array, least: float) -> None:
        """Tie weak functions of some fields of the same basis to their strongest neighbours.

        A weak function has particles in its support, but its sum over them is below `least`.

        Args:
            names: The fields.
            sums: Sum of each function over the particles.
            least: Bound of the sums [-].
        """
        places = [self.fields[name] for name in names]
        shape = self._shape(places[0].basis)
        weak = np.flatnonzero(
            self.active[places[0].slice][:: places[0].components] & (sums < least)
        )
        tied: list[tuple[int, int]] = []
        for function in weak:
            at = np.unravel_index(function, shape, order="F")
            box = [np.arange(max(i - 1, 0), min(i + 2, n)) for i, n in zip(at, shape, strict=True)]
            near = lattice(box) @ np.cumprod((1, *shape[:-1]))
            strongest = near[sums[near].argmax()]
            if sums[strongest] >= least:
                tied.append((int(function), int(strongest)))
        pairs = np.array(tied, dtype=np.int64).reshape(-1, 1, 2)
        self.tied = np.concatenate(
            [
                (
                    place.start + place.components * pairs + np.arange(place.components)[:, None]
                ).reshape(-1, 2)
                for place in places
            ]
        )
        self.active[self.tied[:, 0]] = False

    def _shape(self, basis: Basis) -> tuple[int, ...]:
        """Number of functions of a basis along each axis."""
        return tuple(_rust.basis_len(basis, n) for n in self.grid.cells)

    def _of_all(self, of_functions: Callable[[Basis], Any]) -> Any:
        """Values for all coefficients, from those for the functions of each basis."""
        bases = dict.fromkeys(field.basis for field in self.fields.values())
        of_basis = {basis: of_functions(basis) for basis in bases}
        return np.concatenate(
            [np.repeat(of_basis[f.basis], f.components) for f in self.fields.values()]
        )

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
        number = self.grid.cell_numbers(self.grid.rectangle.ij[cells])
        dofs = self._space.dofs[cells]
        rows, columns, values, done = [], [], [], 0
        for field in self.fields.values():
            functions, at_nodes = self._at_nodes(field.basis, field.degree, number)
            width = at_nodes.shape[1] * field.components
            of_nodes = dofs[:, done : done + width].reshape(-1, field.components)
            done += width
            once = np.unique(of_nodes[:, 0], return_index=True)[1]  # (cell, node) of each row
            functions = functions[once // at_nodes.shape[1]]
            at_nodes = at_nodes.reshape(-1, at_nodes.shape[2])[once]
            components = np.arange(field.components)
            shape = (*functions.shape, len(components))
            columns.append(field.start + len(components) * functions[..., None] + components)
            rows.append(np.broadcast_to(of_nodes[once][:, None], shape))
            values.append(np.broadcast_to(at_nodes[..., None], shape))
        flat = [
            np.concatenate([part.ravel() for part in parts]) for parts in (values, rows, columns)
        ]
        matrix = sp.csr_matrix((flat[0], (flat[1], flat[2])), shape=(self._space.size, self.size))
        matrix.eliminate_zeros()
        return matrix

    def on_cell(self, cell: Indices) -> tuple[Indices, Array]:
        """Coefficients on a cell (i, j), and T: degrees of freedom of a kernel = T coefficients."""
        number = np.array([self.grid.cell_numbers(cell)])
        coefficients, blocks = [], []
        for field in self.fields.values():
            functions, at_nodes = self._at_nodes(field.basis, field.degree, number)
            components = np.arange(field.components)
            first = field.start + field.components * functions[0]
            coefficients.append((first[:, None] + components).ravel())
            blocks.append(np.kron(at_nodes[0], np.eye(field.components)))
        return np.concatenate(coefficients), sp.block_diag(blocks).toarray()

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
        """Coefficients of the displacement, and of the volumetric strain or pressure (None without)."""
        volumetric = None if self.volumetric is None else coefficients[self.volumetric.slice]
        return coefficients[: self.num_displacement], volumetric

    def name_of(self, coefficient: int) -> str:
        """Name of the field of a coefficient."""
        return next(name for name, field in self.fields.items() if coefficient < field.stop)

    def cells_of(self, coefficient: int) -> Indices:
        """Cells (i, j) with particles in the support of a coefficient's function, cells x axes."""
        field = self.fields[self.name_of(coefficient)]
        return self._of_cells.support(field.basis, (coefficient - field.start) // field.components)
