"""The ghost penalty at small strain: full cells have none, cut ones do."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

import tawami


def block(ghost, base=0.0, geometry="plane_strain", **options):
    """A block that is pulled along its axis, and held at the lines of the grid."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0.0, 0.0), h=0.25, cells=(5, 6), geometry=geometry)
    body = tawami.box(grid, (0.0, base), (0.75, 1.0), **options)
    law = tawami.linear_elastic(E=1e3, nu=0.49)
    scene = tawami.Scene(grid, body, law, ghost_penalty=ghost)
    scene.hold((1e-9, 0.5), "x")
    scene.hold((1e-9, 0.75), "x")
    scene.hold((0.5, 0.5), "y")
    return scene


@pytest.mark.parametrize("geometry", ["plane_strain", "axisymmetric"])
@pytest.mark.parametrize("gauss", [False, True])
def test_bodies_on_the_lines_keep_their_digits(geometry, gauss):
    scenes = [block(ghost, geometry=geometry, gauss=gauss) for ghost in ("off", "on")]
    c = np.random.default_rng(3).standard_normal(scenes[0].num_coefficients)
    np.testing.assert_array_equal(*(scene.residual(c) for scene in scenes))
    assert abs(scenes[0].tangent(c) - scenes[1].tangent(c)).max() == 0


@pytest.mark.parametrize("geometry", ["plane_strain", "axisymmetric"])
def test_only_cut_cells_have_sides(geometry):
    """The cells of the lowest row, and the sides that they share: two with each other, three above."""
    for base, rows, count in ((0.1, 0, 5), (0.1 + 0.25, 1, 5), (0.25, 1, 0), (1e-8, 0, 0)):
        sides = block("on", base, geometry).configuration.domain.assembly.attachment.sides
        assert len(sides) == count
        assert all(here[1] == rows for here, _, _ in sides)


def test_a_cut_body_has_the_penalty_by_default():
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0.0, 0.0), h=0.25, cells=(5, 6))
    body = tawami.disc(grid, (0.6, 0.7), 0.5)
    law = tawami.linear_elastic(E=1e3, nu=0.49)
    default, on, off = (
        tawami.Scene(grid, body, law, **options)
        for options in ({}, {"ghost_penalty": "on"}, {"ghost_penalty": "off"})
    )
    c = np.random.default_rng(3).standard_normal(default.num_coefficients)
    np.testing.assert_array_equal(default.residual(c), on.residual(c))
    assert np.abs(default.residual(c) - off.residual(c)).max() > 1
