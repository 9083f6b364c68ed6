"""Division of the cells of a grid among ranks: boxes that cover it, of nearly equal weight."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

from tawami.grid.division import EMPTY, Division

SELF = MPI.COMM_SELF


def weighed(cells: tuple[int, int], weight: np.ndarray, parts: int) -> Division:
    index = np.argwhere(weight)
    return Division.weighed(SELF, parts, cells, index, weight[weight > 0])


@pytest.mark.parametrize("parts", [1, 2, 3, 5, 8])
@pytest.mark.parametrize("cells", [(1, 1), (2, 1), (3, 5), (40, 7)])
def test_boxes_cover_the_grid_once_and_are_those_of_rank_of(cells, parts):
    weight = np.random.default_rng(1).integers(0, 9, cells)
    division, index = weighed(cells, weight, parts), np.argwhere(np.ones(cells))
    inside = (index[:, None] >= division.lower) & (index[:, None] < division.upper)
    assert (inside.all(axis=2).sum(axis=1) == 1).all()
    assert (inside.all(axis=2).argmax(axis=1) == division.rank_of(index)).all()
    again = Division(cells, division.cuts)
    assert (again.lower == division.lower).all()
    assert (again.upper == division.upper).all()


@pytest.mark.parametrize("parts", [2, 4, 7])
def test_a_body_in_a_corner_of_its_grid_is_shared_evenly(parts):
    weight = np.zeros((80, 14), dtype=int)
    weight[:28, :14] = 1000
    of_ranks = np.zeros(parts)
    index = np.argwhere(weight)
    np.add.at(of_ranks, weighed((80, 14), weight, parts).rank_of(index), weight[*index.T])
    line = 1000 * 14  # no cut can be finer than a line of cells
    assert np.abs(of_ranks - of_ranks.mean()).max() <= line + EMPTY * weight.size


def test_cells_without_particles_are_shared_too():
    division = weighed((64, 64), np.zeros((64, 64), dtype=int), 4)
    assert ((division.upper - division.lower).prod(axis=1) == 64 * 64 / 4).all()
