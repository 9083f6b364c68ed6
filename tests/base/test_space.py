"""The space of the grid, and numbers of cells."""

from __future__ import annotations

import numpy as np
import pytest
from scenes import grid_of

import tawami
from tawami.base.space import AXISYMMETRIC, PLANE, Space, lattice, tensor_product

#: No grid is three-dimensional yet; the names of its space are known already.
SOLID = Space(axes=("x", "y", "z"), volume="m3", depth="")


def test_names_of_components():
    assert PLANE.tensor == ("xx", "yy", "zz", "xy")
    assert PLANE.gradient == ("xx", "xy", "yx", "yy")
    assert AXISYMMETRIC.gradient == ("xx", "xy", "yx", "yy", "zz")
    assert (PLANE.num_strains, AXISYMMETRIC.num_strains, SOLID.num_strains) == (3, 4, 6)
    assert SOLID.tensor == ("xx", "yy", "zz", "xy", "xz", "yz")
    assert len(SOLID.gradient) == 9


def test_cells_and_units():
    assert (PLANE.dim, PLANE.num_vertices, PLANE.measure(0.5)) == (2, 4, 0.25)
    assert (SOLID.dim, SOLID.num_vertices, SOLID.measure(0.5)) == (3, 8, 0.125)
    assert (PLANE.unit("N"), SOLID.unit("N")) == ("N per m", "N")


def test_axes():
    assert [PLANE.axis(name) for name in "xy"] == [0, 1]
    with pytest.raises(tawami.InputError, match="component 'z': expected 'x' or 'y'"):
        PLANE.axis("z")


def test_points_of_a_lattice():
    points = lattice([np.array([1, 2, 3]), np.array([10, 20])])
    assert points.tolist() == [[1, 10], [2, 10], [3, 10], [1, 20], [2, 20], [3, 20]]
    assert lattice([np.arange(2)] * 3)[[1, 2, 4]].tolist() == [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
    weights = tensor_product([np.array([1.0, 2.0, 3.0]), np.array([1.0, 10.0])])
    assert weights.tolist() == [1, 2, 3, 10, 20, 30]


def test_numbers_of_cells():
    grid = grid_of((4, 3))
    assert grid.num_cells == 12
    assert (grid.cell_numbers(grid.cell_indices(np.arange(12))) == np.arange(12)).all()
    middle = grid.in_cells(
        np.array([[0.75, 1.25], [1.0, 2.0]])
    )  # the second is a corner of the grid
    index = grid.cell_at(middle)
    assert index.tolist() == [[3, 1], [3, 2]]
    found = grid.rust.locate(grid.in_metres(middle))
    assert grid.cell_numbers(index).tolist() == np.asarray(found.cell).tolist()


@pytest.mark.parametrize(
    ("low", "high", "expected"),
    [(-1.0, 1.0, (0, 4)), (-0.5, 0.5, (1, 3)), (-0.5, 0.4, None), (-1.5, 1.0, None),
     (0.0, 1.5, None), (0.5, 0.5, (3, 3)), (-1.0, 1e308, None), (np.nan, 1.0, None)],
)  # fmt: skip
def test_cells_between_lines_of_the_grid(low, high, expected):
    assert grid_of((4, 3)).cells_between(0, low, high) == expected
