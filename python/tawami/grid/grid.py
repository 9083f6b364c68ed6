"""The background grid: squares on a communicator, and its dolfinx mesh."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from tawami import _rust
from tawami.base import program, ranks
from tawami.base.checks import number, one_of, pair, point, room, shown, whole_number
from tawami.base.errors import InputError
from tawami.base.process import Unique, check_process
from tawami.fem import dolfinx

Array = npt.NDArray[np.float64]
Edge = Literal["left", "right", "bottom", "top"]
EDGES: tuple[Edge, ...] = ("left", "right", "bottom", "top")
#: Cells from (0, 0) to the origin of a grid from which on positions are off by more than 1e-7 cells.
FAR = 1e9
#: Sides of a cell [m] whose squares, and what is divided by these, are numbers.
SMALLEST, LARGEST = 1e-100, 1e100
#: Memory that a cell takes in the mesh and in what a scene keeps of it, measured [bytes].
CELL = 600.0


class Grid(Unique):
    """Uniform grid of squares; all scenes on it share its dolfinx mesh.

    Args:
        comm: Communicator, as MPI.COMM_WORLD; the cells are shared out among its ranks.
        origin: Lower left corner [m].
        h: Side of a cell [m].
        cells: Number of cells in x and y.

    Raises:
        InputError: A parameter out of its range, or no communicator.
    """

    def __init__(
        self, comm: Any, *, origin: Sequence[float], h: float, cells: Sequence[int]
    ) -> None:
        if not isinstance(comm, MPI.Comm) or comm == MPI.COMM_NULL:
            raise InputError(
                f"comm = {shown(comm)}: expected a communicator, as mpi4py's MPI.COMM_WORLD"
            )
        check_process()
        program.watch(comm)
        self.comm = comm
        self.origin = point("origin", origin)
        self.h = number("h", h)
        self.cells = _cells(cells)
        nx, ny = self.cells
        advice = "expected fewer cells, or more ranks"
        room(f"cells = {shown(cells)}", nx * ny, CELL / comm.size, advice)
        self.rust = _rust.Grid(self.origin, self.h, self.cells)
        number("h", h, low=SMALLEST, high=LARGEST)
        if max(map(abs, self.origin)) > FAR * self.h:
            raise InputError(
                f"origin = {self.origin}: expected at most {FAR:g} cells of {self.h:g} m from (0, 0): "
                "farther away positions have too few digits; move body and grid nearer"
            )
        self._rectangle: dolfinx.Rectangle | None = None
        self._spaces: dict[int, dolfinx.Space] = {}

    @property
    def upper(self) -> tuple[float, float]:
        """Upper right corner [m]."""
        (x, y), (nx, ny) = self.origin, self.cells
        return (x + self.h * nx, y + self.h * ny)

    @property
    def extent(self) -> str:
        """Its range in words [m]."""
        (x, y), (x1, y1) = self.origin, self.upper
        return f"[{x:g}, {x1:g}] x [{y:g}, {y1:g}]"

    def identity(self) -> dict[str, Any]:
        """What tells it from another grid, for checkpoints."""
        return {"grid": [list(self.origin), self.h, list(self.cells)]}

    @property
    def rectangle(self) -> dolfinx.Rectangle:
        """The dolfinx mesh, made when it is first needed."""
        if self._rectangle is None:
            self._rectangle = dolfinx.Rectangle(self.comm, self.origin, self.h, self.cells)
        return self._rectangle

    @functools.cached_property
    def rank_of_cell(self) -> npt.NDArray[np.int64]:
        """The rank that each cell, and the particles in it, live on; x fastest."""
        ij = self.rectangle.ij
        rank = np.zeros(self.cells[0] * self.cells[1], dtype=np.int64)
        rank[ij[:, 0] + self.cells[0] * ij[:, 1]] = self.comm.rank
        return ranks.sum_of(self.comm, rank)

    def space(self, num_fields: int, element: Any) -> dolfinx.Space:
        """The function space of displacement and `num_fields - 1` bilinear fields."""
        if num_fields not in self._spaces:
            self._spaces[num_fields] = dolfinx.Space(self.rectangle, element)
        return self._spaces[num_fields]

    def edge(self, name: Edge) -> tuple[int, int]:
        """Axis normal to an edge of the grid, and 0 for its lower or -1 for its upper end.

        Raises:
            InputError: No such edge.
        """
        if not one_of(name, EDGES):
            raise InputError(f"edge {shown(name)}: expected 'left', 'right', 'bottom' or 'top'")
        return EDGES.index(name) // 2, -(EDGES.index(name) % 2)

    def axis_positions(self, axis: int, cell: Any, t: Any) -> Array:
        """Coordinates [m] along an axis of positions `t` (0 to 1) in cells."""
        return np.asarray(self.origin[axis] + self.h * (np.asarray(cell) + np.asarray(t)))


def _cells(cells: Sequence[int]) -> tuple[int, int]:
    nx, ny = pair("cells", cells, "whole numbers")
    return whole_number("cells[0]", nx, low=1), whole_number("cells[1]", ny, low=1)
