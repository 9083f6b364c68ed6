"""The background grid: cells of one size on a communicator."""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from typing import Any, Literal, cast, get_args

import numpy as np
from mpi4py import MPI

from tawami import _rust
from tawami.base import program
from tawami.base.arrays import Array, Indices
from tawami.base.checks import choice, number, one_of, pair, point, room, shown, whole_number
from tawami.base.errors import InputError
from tawami.base.process import Unique, check_process
from tawami.base.space import SPACES, Counts, Position
from tawami.base.text import meant, position
from tawami.fem import mesh
from tawami.grid.division import Division
from tawami.grid.window import Window

Edge = Literal["left", "right", "bottom", "top"]
EDGES: tuple[Edge, ...] = get_args(Edge)
Geometry = Literal["plane_strain", "axisymmetric"]
#: A position is on a line of the grid if it is this near to it [cells].
ON_LINE = 1e-6
#: Largest distance of the origin from (0, 0) [cells]: beyond it, positions are off by over 1e-7 cells.
FARTHEST = 1e9
#: Limits of the side of a cell [m]: its powers, and quotients by them, stay finite and above 0.
SMALLEST, LARGEST = 1e-100, 1e100
#: Memory of a cell in the mesh and in the arrays of a scene, measured [bytes].
BYTES_PER_CELL = 600.0


class Grid(Unique):
    """Uniform grid of squares.

    Attributes:
        space: Dimension, names of components and units.
        geometry: As given.
        division: Cells of each rank; a scene divides them by their particles.

    Args:
        comm: Communicator, such as MPI.COMM_WORLD; its ranks share the cells.
        origin: Lower left corner [m].
        h: Side of a cell [m].
        cells: Number of cells in x and y.
        geometry: 'plane_strain', where volumes, forces and energies are per metre depth; or
            'axisymmetric' about the line x = 0, where x is the radius, y the axis and zz the hoop
            direction, and they are those of the whole revolution.

    Raises:
        InputError: A parameter is out of its range, or `comm` is not a communicator.
    """

    def __init__(
        self,
        comm: Any,
        *,
        origin: Sequence[float],
        h: float,
        cells: Sequence[int],
        geometry: Geometry = "plane_strain",
    ) -> None:
        if not isinstance(comm, MPI.Comm) or comm == MPI.COMM_NULL:
            raise InputError(
                f"comm = {shown(comm)}: expected a communicator, such as mpi4py's MPI.COMM_WORLD"
            )
        check_process()
        program.watch(comm)
        self.comm = comm
        self.geometry = choice("geometry", geometry, SPACES)
        self.space = SPACES[geometry]
        self.origin = point("origin", origin)
        self.h = number("h", h)
        self.cells = _cells(cells)
        advice = "expected fewer cells, or more ranks"
        room(f"cells = {shown(cells)}", self.num_cells, BYTES_PER_CELL / comm.size, advice)
        self.rust = _rust.Grid(self.origin, self.h, self.cells, geometry)
        number("h", h, low=SMALLEST, high=LARGEST)
        if max(map(abs, self.origin)) > FARTHEST * self.h:
            raise InputError(
                f"origin = {self.origin}: expected at most {FARTHEST:g} cells of {self.h:g} m from "
                "(0, 0): farther away, positions have too few digits; move body and grid nearer"
            )
        none = np.zeros((0, self.space.dim), dtype=np.int64)
        self.division = Division.weighed(MPI.COMM_SELF, comm.size, self.cells, none, none[:, 0])
        self._function_spaces: dict[str, mesh.FunctionSpace] = {}

    @property
    def num_cells(self) -> int:
        """Number of all cells."""
        return math.prod(self.cells)

    @property
    def upper(self) -> Position:
        """Upper right corner [m]."""
        corner = (x + self.h * n for x, n in zip(self.origin, self.cells, strict=True))
        return cast(Position, tuple(corner))

    @property
    def on_axis(self) -> bool:
        """Whether its left edge is the axis of axisymmetry."""
        return self.space.hoop and self.origin[0] == 0

    @property
    def extent(self) -> str:
        """Its range along each axis [m], as text."""
        ends = zip(self.origin, self.upper, strict=True)
        return " x ".join(f"[{low:g}, {high:g}]" for low, high in ends)

    @property
    def line(self) -> str:
        """The grid in words, for the header of a run."""
        cells = " x ".join(map(str, self.cells))
        about = ", axisymmetric about x = 0" if self.space.hoop else ""
        corners = f"from {position(self.origin)} to {position(self.upper)}"
        return f"{cells} cells of {self.h:g} m {corners}{about}"

    def __repr__(self) -> str:
        cells = " x ".join(map(str, self.cells))
        about = ", axisymmetric" if self.space.hoop else ""
        return f"Grid({cells} cells of {self.h:g} m, {self.extent} m{about})"

    @property
    def lattice(self) -> tuple[Position, float, Counts]:
        """Origin [m], side of a cell [m] and numbers of cells."""
        return self.origin, self.h, self.cells

    def with_cells(self, h: float, cells: Sequence[int]) -> Grid:
        """The grid with other cells, from the same corner on.

        Args:
            h: Side of a cell [m].
            cells: Numbers of cells.
        """
        return Grid(self.comm, origin=self.origin, h=h, cells=cells, geometry=self.geometry)

    @property
    def halved(self) -> Grid:
        """The grid with cells of h/2."""
        return self.with_cells(self.h / 2, [2 * n for n in self.cells])

    def identity(self) -> dict[str, Any]:
        """Facts that identify the grid, for checkpoints."""
        return {
            "grid": [list(self.origin), self.h, list(self.cells)],
            "geometry": self.geometry,
        }

    @functools.cached_property
    def window(self) -> Window:
        """The part of the grid that this rank knows."""
        return Window(self.comm, self.origin, self.h, self.rust, self.division)

    def divided(self, division: Division) -> Grid:
        """The same grid with other cells for each rank; itself if they are the same."""
        if np.array_equal(division.cuts, self.division.cuts):
            return self
        other = self.with_cells(self.h, self.cells)
        other.division = division
        return other

    def divided_by(self, cell: Indices) -> Grid:
        """The same grid whose cells are divided by particles; a collective call.

        Args:
            cell: Number of the cell of each particle of this rank.
        """
        if self.comm.size == 1:
            return self
        return self.divided(Division.by_particles(self.comm, self.cells, cell))

    @functools.cached_property
    def rectangle(self) -> mesh.Rectangle:
        """The dolfinx mesh; the first call is one for all ranks."""
        box = self.division.lower[self.comm.rank], self.division.upper[self.comm.rank]
        return mesh.Rectangle(self.comm, self.origin, self.h, self.cells, box)

    def function_space(self, element: Any) -> mesh.FunctionSpace:
        """The function space of an element."""
        key = repr(element)
        if key not in self._function_spaces:
            self._function_spaces[key] = mesh.FunctionSpace(self.rectangle, element)
        return self._function_spaces[key]

    def edge(self, name: Edge) -> tuple[int, int]:
        """Axis normal to an edge of the grid, and 0 for its lower or -1 for its upper end.

        Raises:
            InputError: No such edge.
        """
        if not one_of(name, EDGES):
            hint = meant(name, EDGES) if isinstance(name, str) else ""
            raise InputError(
                f"edge {shown(name)}: expected 'left', 'right', 'bottom' or 'top'{hint}"
            )
        return EDGES.index(name) // 2, -(EDGES.index(name) % 2)

    def line_of_edge(self, name: Edge) -> float:
        """Coordinate [m] of an edge of the grid along its normal axis.

        Raises:
            InputError: No such edge.
        """
        axis, end = self.edge(name)
        return self.upper[axis] if end else self.origin[axis]

    def inwards(self, name: Edge, x: Array) -> Array:
        """Distances [m] of positions from an edge of the grid, positive inside, points x dim.

        Raises:
            InputError: No such edge.
        """
        axis, end = self.edge(name)
        distance = x[:, axis] - self.line_of_edge(name)
        return -distance if end else distance

    def axis_positions(self, axis: int, cell: Any, t: Any) -> Array:
        """Coordinates [m] along an axis of positions `t` (0 to 1) in cells."""
        return np.asarray(self.origin[axis] + self.h * (np.asarray(cell) + np.asarray(t)))

    def cells_between(self, axis: int, low: float, high: float) -> tuple[int, int] | None:
        """First cell of a range along an axis [m], and the cell after its last one.

        None if the range does not go from one line of the grid to another.
        """
        with np.errstate(over="ignore", invalid="ignore"):
            ends = (np.array([low, high]) - self.origin[axis]) / self.h
            first, last = np.rint(ends)
            on_lines = np.abs(ends - [first, last]).max() <= ON_LINE
        if not (on_lines and first >= 0 and last <= self.cells[axis]):
            return None
        return int(first), int(last)

    def in_cells(self, x: Array) -> Array:
        """Positions [m], of shape (..., dim), in cells from the origin."""
        return (x - self.origin) / self.h

    def in_metres(self, x: Array) -> Array:
        """Positions in cells from the origin, of shape (..., dim), in metres."""
        return self.origin + self.h * x

    def positions(self, location: _rust.Location) -> Array:
        """Positions [m] of points in cells of the window, points x dim."""
        return self.in_metres(self.window.indices(location.cell.astype(np.int64)) + location.xi)

    def cell_at(self, x: Array) -> Indices:
        """Indices (i, j) of the cells that hold positions in cells, points x dim."""
        return np.clip(np.floor(x), 0, np.subtract(self.cells, 1)).astype(np.int64)

    def cell_numbers(self, index: Indices) -> Indices:
        """Numbers of cells, given their indices (i, j), cells x dim; x fastest."""
        strides = np.cumprod((1, *self.cells[:-1]))
        return index @ strides

    def cell_indices(self, number: Indices) -> Indices:
        """Indices (i, j) of cells, cells x dim, given their numbers."""
        return np.stack(np.unravel_index(number, self.cells, order="F"), axis=-1)


def _cells(cells: Sequence[int]) -> Counts:
    nx, ny = pair("cells", cells, "whole numbers")
    return whole_number("cells[0]", nx, low=1), whole_number("cells[1]", ny, low=1)
