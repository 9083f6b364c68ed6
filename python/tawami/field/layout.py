"""Places of the coefficients of all fields, and the functions of cells at their nodes.

The coefficients of all fields form one vector, in the order of the form: the displacement first. Those
of a field go function by function and component by component. The rows of the extraction matrix E, which
gives the degrees of freedom of a mesh (nodal = E coefficients), are the values at the nodes of cells.

A rank has the coefficients of its window (`tawami.grid.window`). Each coefficient belongs to one rank,
and others have copies of it. `Layout.whole` and `Layout.part` convert to and from the coefficients of
the whole grid, in the same order.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from tawami import _rust
from tawami.base.arrays import Array, Indices, Mask
from tawami.base.exchange import Exchange
from tawami.base.space import lattice
from tawami.fem import dolfinx
from tawami.field.coefficients import Coefficients, places_of
from tawami.field.functions import ActiveFunctions
from tawami.form.fields import Field
from tawami.grid.basis import Basis
from tawami.grid.grid import Grid


class Layout(Coefficients):
    """Places of the coefficients of a rank's window, and functions at the nodes of cells.

    Making one is a collective call.

    Args:
        grid: The grid.
        basis: Basis of the displacement.
        fields: The fields of the form; the displacement comes first.
        active: Whether each cell of the window holds particles, on any rank, x fastest.

    Attributes:
        fields: Place of each field by name.
        of_grid: The same among the coefficients of the whole grid.
        volumetric: Place of the volumetric strain or pressure; None without such a field.
        num_displacement: Number of displacement coefficients; the other fields follow.
        size: Number of coefficients.
        functions: The active functions.
        active: Whether each coefficient belongs to a function with a particle in its support.
        owner: Rank of each active coefficient: one with a cell in the support of the function; -1 for
            coefficients that are not active, or whose functions are not known in the window.
        exchange: The exchange of coefficients between ranks.
        tied: Pairs of coefficients, the first of which follows the second.
    """

    def __init__(
        self,
        grid: Grid,
        basis: Basis,
        fields: Mapping[str, Field],
        active: Mask,
    ) -> None:
        self.grid, self.basis = grid, basis
        self.window = grid.window
        self.fields = places_of(fields, basis, self.window.cells)
        self.of_grid = places_of(fields, basis, grid.cells)
        places = list(self.fields.values())
        self.num_displacement, self.size = places[0].stop, places[-1].stop
        roles = {field.role: self.fields[name] for name, field in fields.items()}
        self.volumetric = roles.get("volumetric_strain", roles.get("pressure"))
        self.functions = ActiveFunctions(grid, active)
        self.owner = np.concatenate(
            [np.repeat(self.functions.owner(f.basis), f.components) for f in self.fields.values()]
        )
        self.active: Mask = self.owner >= 0
        parts = [
            (self.functions.exchange(f.basis), f.start, f.components) for f in self.fields.values()
        ]
        self.exchange = Exchange.joined(grid.comm, parts)
        self.tied: Indices = np.empty((0, 2), dtype=np.int64)

    def same_cells(self, other: Layout) -> bool:
        """Whether another layout has the same functions and active cells, on this rank."""
        if self is other:
            return True
        same = self.grid is other.grid and self.fields == other.fields
        return same and np.array_equal(self.functions.cells, other.functions.cells)

    @functools.cached_property
    def parts(self) -> tuple[int, Indices]:
        """Number of parts of the body that share no displacement function, and the part of each
        displacement coefficient, -1 for inactive ones; the first call is one for all ranks.
        """
        number, part = self.functions.parts(self.basis)
        return number, np.repeat(part, self.grid.space.dim)

    def tie(self, names: Sequence[str], sums: Array, least: float) -> None:
        """Tie weak functions of some fields of the same basis to their strongest neighbours.

        A weak function has particles in its support, but its sum over them is below `least`.

        Args:
            names: The fields.
            sums: Sum of each function over the particles.
            least: Bound of the sums [-].
        """
        places = [self.fields[name] for name in names]
        basis, shape = places[0].basis, self.window.shape(places[0].basis)
        weak = np.flatnonzero((self.functions.owner(basis) >= 0) & (sums < least))
        #: The function of the whole grid that each function follows; -1 for none.
        leader = np.full(len(sums), -1)
        for function in weak:
            at = np.unravel_index(function, shape, order="F")
            box = [np.arange(max(i - 1, 0), min(i + 2, n)) for i, n in zip(at, shape, strict=True)]
            near = lattice(box) @ np.cumprod((1, *shape[:-1]))
            strongest = near[sums[near].argmax()]
            if sums[strongest] >= least:
                leader[function] = self.window.in_grid(basis, strongest)
        self.functions.exchange(basis).update(leader)  # its owner knows all of its neighbours
        followers = np.flatnonzero(leader >= 0)
        leaders = self.window.functions(basis, leader[followers])
        pairs = np.column_stack([followers, leaders])[leaders >= 0].reshape(-1, 1, 2)
        self.tied = np.concatenate(
            [
                (
                    place.start + place.components * pairs + np.arange(place.components)[:, None]
                ).reshape(-1, 2)
                for place in places
            ]
        )
        for place in places:
            for component in range(place.components):
                self.active[place.start + place.components * followers + component] = False

    def reached_by(self, cells: Any) -> Mask:
        """Whether each coefficient belongs to a function with one of these cells in its support."""
        return np.concatenate(
            [
                np.repeat(self.functions.reached_by(cells, f.basis), f.components)
                for f in self.fields.values()
            ]
        )

    def on_cells(self, cells: Indices) -> tuple[Indices, Array]:
        """Coefficients on cells (i, j) of the grid (cells x coefficients), and T of each: degrees of
        freedom of a kernel = T coefficients.
        """
        number = self.window.numbers(cells)
        coefficients, blocks = [], []
        for field in self.fields.values():
            functions, at_nodes = self.at_nodes(field.basis, field.degree, number)
            components = np.arange(field.components)
            first = field.start + field.components * functions
            coefficients.append((first[:, :, None] + components).reshape(len(cells), -1))
            blocks.append(np.kron(at_nodes, np.eye(field.components)))
        columns = np.concatenate(coefficients, axis=1)
        t = np.zeros((len(cells), sum(block.shape[1] for block in blocks), columns.shape[1]))
        row = column = 0
        for block in blocks:
            _, height, width = block.shape
            t[:, row : row + height, column : column + width] = block
            row, column = row + height, column + width
        return columns, t

    def at_nodes(self, basis: Basis, degree: int, cells: Indices) -> tuple[Indices, Array]:
        """Functions on cells (cells x functions), and their values at Lagrange nodes of a degree
        (cells x nodes x functions).
        """
        return _rust.extraction(basis, self.window.cells, cells, dolfinx.reference_nodes(degree))

    @property
    def greville(self) -> Array:
        """Greville points [m] of the displacement functions, functions x components."""
        return self.window.greville(self.basis)

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
        return self.functions.support(field.basis, (coefficient - field.start) // field.components)
