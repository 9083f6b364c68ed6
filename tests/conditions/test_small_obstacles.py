"""Obstacles about as small as a cell enter the body between patches: a warning, never silence."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

import tawami

H = 0.25


def bed(form="u_epsv_finite"):
    """An elastic bed whose surface is a line of the grid."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=H, cells=(8, 6))
    body = tawami.box(grid, (0, 0), (2, 1), per_axis=3)
    scene = tawami.Scene(
        grid, body, tawami.linear_elastic(E=1e6, nu=0.2), form=form, ghost_penalty="on"
    )
    for side, component in (("bottom", "x"), ("bottom", "y"), ("left", "x"), ("right", "x")):
        scene.fix(side, component)
    return scene


def plate(x, y):
    """Distance from a plate with its lower end above the bed."""
    across, below = np.abs(x - 1.1) - 0.03, 1.01 - y
    outside = np.hypot(np.maximum(across, 0), np.maximum(below, 0))
    return outside + np.minimum(np.maximum(across, below), 0)


@pytest.mark.parametrize("shape", [
    plate,
    tawami.rigid_disc((1.1, 1 + 0.3 * H), 0.3 * H),
    tawami.rigid_polygon([(1.1, 1), (1.15, 2), (1.05, 2)]),
    tawami.rigid_polygon([(1.1, 1.05), (1.2, 1.05), (1.2, 2), (1.1, 2)], radius=0.05),
])  # fmt: skip
def test_a_shape_narrower_than_a_cell_warns(shape):
    assert getattr(shape, "width", 0.06) < H
    with pytest.warns(tawami.SupportWarning, match="at its narrowest place, less than a cell"):
        bed().obstacle(shape, where="top")


@pytest.mark.parametrize("form", ["u_epsv", "u_epsv_finite"])
def test_a_distance_that_enters_the_body_between_patches_warns_once(form):
    """A pin, of which a distance function does not tell the width."""
    scene = bed(form)

    def pin(x, y):
        return np.hypot(x - 1.1, np.maximum(1 + 0.45 * H - y, 0.0)) - 0.45 * H

    scene.obstacle(pin, where="top", displacement=(0.0, -0.8 * H))
    with pytest.warns(
        tawami.SupportWarning, match="a particle of the body is .* m inside it"
    ) as told:
        tawami.ramp(scene, 0.5)
    assert sum("inside it" in str(one.message) for one in told) == 1


def test_an_obstacle_as_wide_as_a_few_cells_stays_outside_without_a_warning():
    scene = bed()
    disc = tawami.rigid_disc((1.1, 1 + 2 * H), 2 * H)
    assert disc.width == 4 * H
    scene.obstacle(disc, where="top", displacement=(0.0, -0.4 * H))
    tawami.ramp(scene, 0.5)
    assert scene.solve().contact("obstacle 1").force[1] > 0
