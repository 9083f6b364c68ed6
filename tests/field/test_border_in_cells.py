"""The functions of the grid at border points: they add up to 1 and are exact for linear fields."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

import tawami
from tawami import _rust
from tawami.base.errors import SupportError
from tawami.field.border import BorderInCells


@pytest.fixture
def grid():
    return tawami.Grid(MPI.COMM_SELF, origin=(-0.3, 0.2), h=0.25, cells=(6, 5))


def circle(centre=(0.42, 0.83), radius=0.31, count=40):
    angle = 2 * np.pi * np.arange(count) / count
    normal = np.column_stack([np.cos(angle), np.sin(angle)])
    return np.array(centre) + radius * normal, normal


@pytest.mark.parametrize("basis", ["quadratic_spline", "bilinear", "biquadratic"])
@pytest.mark.parametrize("holes", [False, True])
def test_functions_add_up_to_one_and_give_linear_fields(grid, basis, holes):
    x, normal = circle()
    active = np.ones(grid.cells[::-1], dtype=bool)
    if holes:
        active[2:, 3:] = False  # points there read the nearest cell with particles
    border = BorderInCells(grid, active, x, normal)
    assert active.ravel()[border.location.cell].all()
    size = [_rust.basis_len(basis, n) for n in grid.cells]
    along = [greville(basis, n) for n in grid.cells]
    places = np.stack([a.ravel(order="F") for a in np.meshgrid(*along, indexing="ij")], axis=1)
    field = 2.0 + grid.in_metres(places) @ [3.0, -5.0]
    assert field.shape == (np.prod(size),)
    assert border.at(basis, 0 * field[:, None] + 1)[:, 0] == pytest.approx(
        np.ones(len(x)), abs=1e-13
    )
    assert border.at(basis, field[:, None])[:, 0] == pytest.approx(2 + x @ [3, -5], abs=1e-12)
    slopes = np.column_stack([s @ field for s in border.of_rank.slopes(basis)])
    assert slopes == pytest.approx(np.tile([3.0, -5.0], (len(x), 1)), abs=1e-11)


def greville(basis, n):
    if basis == "quadratic_spline":
        return np.concatenate([[0.0], np.arange(n) + 0.5, [n]])
    return np.linspace(0, n, n + 1 if basis == "bilinear" else 2 * n + 1)


def test_a_point_on_a_line_belongs_to_the_cell_of_the_body(grid):
    x = np.array([[0.2, 0.7], [0.2, 0.7]])  # corner of four cells
    normal = np.array([[1.0, 1.0], [-1.0, 0.0]]) / np.sqrt([[2.0], [1.0]])
    border = BorderInCells(grid, np.ones(grid.cells[::-1], dtype=bool), x, normal)
    index = grid.cell_indices(border.location.cell.astype(np.int64))
    assert index[0].tolist() == [1, 1]
    assert index[1, 0] == 2


def test_points_away_from_all_particles_are_rejected(grid):
    x, normal = circle()
    active = np.zeros(grid.cells[::-1], dtype=bool)
    active[0, 0] = True
    with pytest.raises(SupportError, match=r"crest: .* more than 2 cells from any particle"):
        BorderInCells(grid, active, x, normal, "crest")
