"""Active functions on the window of a rank: which rank owns each, and the parts of the body."""

from __future__ import annotations

from typing import Any

import numpy as np

from tawami import _rust
from tawami.base import ranks
from tawami.base.arrays import Array, Indices, Mask
from tawami.base.exchange import Exchange
from tawami.grid.basis import Basis
from tawami.grid.grid import Grid


class ActiveFunctions:
    """Functions with particles in their support, on any rank; a function belongs to one rank.

    Functions whose support is partly outside the window are not known. Making one is a collective call.

    Args:
        grid: The grid.
        active: Whether each cell of the window holds particles, on any rank, x fastest.

    Attributes:
        cells: Numbers of the active cells in the window.
    """

    def __init__(self, grid: Grid, active: Mask) -> None:
        self._grid, self._window = grid, grid.window
        self.cells = np.flatnonzero(active).astype(np.uint32)
        self._of_cells = _rust.Active(self._window.rust, self.cells)
        self._owners: dict[Basis, Indices] = {}
        self._exchanges: dict[Basis, Exchange] = {}

    def owner(self, basis: Basis) -> Indices:
        """Rank that owns each function of a basis, one with a cell of its support; -1 for functions that
        are not active or not known.
        """
        if basis not in self._owners:
            owner = self._of_cells.spread(basis, self._window.rank_of_cell)
            if self._grid.comm.size > 1:
                owner[~self._window.has_support(basis)] = -1
            self._owners[basis] = owner
        return self._owners[basis]

    def exchange(self, basis: Basis) -> Exchange:
        """The exchange of values of the functions; the first call is one for all ranks."""
        if basis not in self._exchanges:
            self._exchanges[basis] = Exchange.of(
                self._grid.comm,
                self.owner(basis),
                lambda function: self._window.in_grid(basis, function),
                lambda number: self._window.functions(basis, number),
            )
        return self._exchanges[basis]

    def sums(
        self,
        location: _rust.Location,
        weight: Array,
        data: Array,
        basis: Basis,
        *,
        squared: bool = False,
    ) -> Array:
        """Sums over the particles of all ranks, sum_p weight_p data_p N_i, or with squares of N_i.

        A collective call.

        Args:
            location: Cells and positions of this rank's particles.
            weight: One number per particle.
            data: Particles x columns.
            basis: Whose functions N_i are.

        Returns:
            Functions of the window x columns, zero for functions that are not known.
        """
        sums = _rust.nodal_sums(location, weight, data, basis, squared)
        return self.exchange(basis).add(sums)

    def dot(self, basis: Basis, a: Array, b: Array) -> float:
        """Scalar product over all ranks of values of functions; a collective call."""
        comm = self._grid.comm
        if comm.size == 1:
            return float(a @ b)
        own = self.owner(basis) == comm.rank
        return float(comm.allreduce(float(a[own] @ b[own])))

    def support(self, basis: Basis, function: int) -> Indices:
        """Indices (i, j) in the grid of the active cells in a function's support, cells x axes."""
        return np.asarray(self._of_cells.support(basis, function) + np.array(self._window.first))

    def parts(self, basis: Basis) -> tuple[int, Indices]:
        """Parts of the body that share no function: how many, and the part of each function, -1 for
        inactive ones; a collective call.
        """
        comm, window = self._grid.comm, self._window
        number, part = self._of_cells.parts(basis)
        if comm.size == 1:
            return number, self._of_cells.spread(basis, part)
        # a part on several ranks has the number of its first cell in the grid
        first = np.full(len(part), np.iinfo(np.int64).max)
        cells = self.cells.astype(np.int64)
        first[cells] = self._grid.cell_numbers(window.indices(cells))
        changed = True
        while changed:
            least = np.full(number, np.iinfo(np.int64).max)
            np.minimum.at(least, part[cells], first[cells])
            before = first.copy()
            first[cells] = least[part[cells]]
            window.of_cells.update(first)
            changed = ranks.anywhere(comm, (first != before).any())
        roots = np.unique(ranks.allgathered(comm, np.unique(first[cells[window.own[cells]]])))
        numbered = np.full(len(part), -1, dtype=np.int64)
        numbered[cells] = np.searchsorted(roots, first[cells])
        return len(roots), self._of_cells.spread(basis, numbered)

    def reached_by(self, cells: Any, basis: Basis) -> Mask:
        """Whether each function has one of these cells of the window in its support."""
        return _rust.Active(self._window.rust, cells).functions(basis)
