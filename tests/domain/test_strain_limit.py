"""A run of small strain warns of displacement gradients that are not small."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from mpi4py import MPI
from scenes import grid_of

import tawami

pytestmark = pytest.mark.filterwarnings("error::tawami.SmallStrainWarning")
SHEAR = 0.25
MESSAGE = r"displacement gradient of particle \d+ is 0\.25.*form='u_epsv_finite'"


def sheared(shear: float, **options) -> tawami.Scene:
    """A block whose edges all move in simple shear."""
    grid = grid_of()
    body = tawami.box(grid, grid.origin, grid.upper, per_axis=2)
    law = tawami.linear_elastic(E=1e3, nu=0.3)
    scene = tawami.Scene(grid, body, law, density=1.0, **options)
    for edge in ("left", "right", "bottom", "top"):
        scene.fix(edge, "x", lambda _x, y: shear * (y - 0.5))
        scene.fix(edge, "y")
    return scene


def warnings_of(run) -> list[str]:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        run()
    return [str(w.message) for w in caught if w.category is tawami.SmallStrainWarning]


def test_a_solve_warns_once_and_names_the_particle():
    scene = sheared(SHEAR)
    with pytest.warns(tawami.SmallStrainWarning, match=MESSAGE) as caught:
        scene.solve()
    assert caught[0].filename == __file__
    assert warnings_of(scene.solve) == []


def test_a_ramp_warns_once_when_the_sum_of_its_steps_is_too_large():
    scene, loads = sheared(SHEAR), []
    found = warnings_of(lambda: tawami.ramp(scene, 0.3, each=lambda s: loads.append(s.load)))
    assert len(found) == 1
    assert "is 0.225" in found[0]  # after three steps of 0.075
    assert len(loads) == 4


def test_a_path_warns():
    grid = grid_of((1, 4), 1.0)
    scene = tawami.Scene(
        grid,
        tawami.box(grid, grid.origin, grid.upper, gauss=True, per_axis=2),
        tawami.linear_elastic(E=1.0, nu=0.0),
    )
    for edge in ("left", "right", "bottom"):
        scene.fix(edge, "x")
    scene.fix("bottom", "y")
    scene.traction("top", (0.0, 1.0))
    found = warnings_of(lambda: tawami.follow(scene, ((-0.5, 4.5), "y"), size=0.3, to=1.2))
    assert len(found) == 1
    assert "is 0.225" in found[0]


def test_a_motion_warns():
    grid = grid_of()
    scene = tawami.Scene(
        grid,
        tawami.box(grid, grid.origin, grid.upper, per_axis=2),
        tawami.linear_elastic(E=1e3, nu=0.3),
        density=1.0,
    )
    for edge in ("left", "right", "bottom", "top"):
        scene.fix(edge, "x", velocity=lambda t: 1.0) if edge == "top" else scene.fix(edge, "y")
    scene.fix("bottom", "x")
    motion = tawami.Dynamics(scene)
    assert len(warnings_of(lambda: motion.run(1.0, 0.1))) == 1


@pytest.mark.parametrize("shear", [0.19, -0.19])
def test_smaller_gradients_give_no_warning(shear):
    sheared(shear).solve()  # warnings are errors


def pulled(form: str, traction: float) -> tawami.Scene:
    """A block of 1 m x 1 m that hangs by a load on its upper particles."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=0.25, cells=(4, 8))
    body = tawami.box(grid, (0, 0), (1, 1), per_axis=2)
    scene = tawami.Scene(grid, body, tawami.linear_elastic(E=10.0, nu=0.3), form=form)
    for edge in ("left", "right"):
        scene.fix(edge, "x")
    scene.fix("bottom", "y")
    scene.load(body.x[:, 1] > 0.75, (0.0, traction))
    return scene


def test_its_advice_helps():
    with pytest.warns(tawami.SmallStrainWarning, match="finite strain .form='u_epsv_finite'."):
        pulled("u_epsv", 4.0).solve()
    pulled("u_epsv_finite", 4.0).solve()  # warnings are errors
    pulled("u_epsv", 1.0).solve()


def test_where_it_is_an_error_nothing_has_changed():
    scene = sheared(SHEAR)
    with pytest.raises(tawami.SmallStrainWarning):
        scene.solve()
    assert not np.any(scene.particles.stress)
    assert not np.any(scene.configuration.total)
