"""Advice in the errors of a step, and that it helps."""

from __future__ import annotations

import re
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from limit_loads import footing, pressed, pulled
from mpi4py import MPI

import tawami
from tawami.solve import linear_solver

UNDER_IT = ((0.0, 2.0), "y")  # the footing
ROOT = Path(tawami.__file__).parent
#: Errors that are raised in each file, all of them with a test here or where the remark says.
RAISED = {
    "motion/modes.py": 1,  # tests/motion/test_modes.py
    "motion/stepping.py": 1,
    "solve/diagnosis.py": 3,
    "solve/direct.py": 2,  # no advice
    "solve/linear_solver.py": 1,
}


MOVES = {"form": "u_epsv_finite"}


def block(
    traction: float = 1e-3, *, materials=None, per_axis: int = 3, cells=(6, 6), **options
) -> tuple[tawami.Scene, np.ndarray]:
    """A block on a rough base with a load on its upper half, which may be of a second material."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=0.25, cells=cells)
    body = tawami.box(grid, (0, 0), (1, 1), per_axis=per_axis)
    upper = body.x[:, 1] > 0.5
    if materials is None:
        materials = tawami.linear_elastic(E=1.0, nu=0.3)
    else:
        options["material_of"] = upper.astype(int)
    scene = tawami.Scene(grid, body, materials, **options)
    for component in ("x", "y"):
        scene.fix("bottom", component)
    scene.load(upper, (traction, -traction))
    return scene, upper


def test_the_list_of_errors_is_complete():
    found = Counter()
    for room in ("solve", "motion"):
        for path in (ROOT / room).glob("*.py"):
            raised = re.findall(r"raise (?:Convergence|Singular)Error\(", path.read_text())
            found[path.relative_to(ROOT).as_posix()] += len(raised)
    assert +found == RAISED


def test_a_ramp_where_one_step_is_too_large():
    with pytest.raises(tawami.ConvergenceError, match=r"ramp\(scene\) applies it in steps"):
        pulled(0.49, 0.2).solve()
    assert tawami.ramp(pulled(0.49, 0.2)).complete


def test_a_ramp_and_a_path_where_the_load_is_too_large():
    scene = pressed(0.49, 0.0)
    with pytest.raises(tawami.ConvergenceError, match=r"follow\(scene, ...\) passes a limit load"):
        scene.solve()
    with pytest.warns(tawami.IncompleteWarning, match="use a smaller `smallest`"):
        coarse = tawami.ramp(scene, 0.2, smallest=0.15)
    with pytest.warns(tawami.IncompleteWarning, match=r"follow\(scene, ...\) passes a limit load"):
        fine = tawami.ramp(scene, 0.2, smallest=0.01)  # of the rest
    assert 0.7 < coarse.reached < 0.9 < coarse.reached + (1 - coarse.reached) * fine.reached < 1
    settlement = scene.configuration.total.min()
    assert tawami.follow(scene, UNDER_IT, size=2e-3, to=-1e-2).complete
    assert scene.configuration.total.min() < settlement - 9e-3
    with pytest.raises(tawami.ConvergenceError, match="Newton did not converge|singular"):
        tawami.ramp(scene, 1.0, smallest=1.0, stop="raise")


def test_a_smaller_load():
    scene = pressed(0.49, 0.0)
    scene.traction(footing, (0.0, 5.6 - 3.0))
    scene.solve()


@pytest.mark.filterwarnings("ignore::tawami.SmallStrainWarning")
def test_shorter_steps_along_a_path():
    def ended(size):
        path = tawami.follow(
            pressed(0.49, 0.0), UNDER_IT, size=size, to=-0.02, smallest=size, stop="raise"
        )
        return path.complete

    with pytest.raises(tawami.ConvergenceError, match="Use shorter steps along the path"):
        ended(0.02)
    assert ended(0.002)


def test_another_control():
    with pytest.raises(tawami.ConvergenceError, match="choose another control"):
        tawami.follow(pressed(0.49, 0.0), ((0.0, 1.0), "x"), size=1e-3, to=2e-3, stop="raise")
    assert tawami.follow(pressed(0.49, 0.0), UNDER_IT, size=1e-3, to=-2e-3).complete


def test_a_smaller_time_step():
    def spinning():
        grid = tawami.Grid(MPI.COMM_WORLD, origin=(-1, -1), h=0.125, cells=(16, 16))
        body = tawami.box(grid, (-0.25, -0.25), (0.25, 0.25), per_axis=2)
        law = tawami.linear_elastic(E=1e5, nu=0.4)
        scene = tawami.Scene(grid, body, law, form="u_epsv_finite", density=1000.0)
        return tawami.Dynamics(
            scene, velocity=20.0 * np.column_stack([-body.x[:, 1], body.x[:, 0]])
        )

    with pytest.raises(tawami.ConvergenceError, match=r"Use a smaller dt; run\(...\) does this"):
        spinning().step(0.2)
    spinning().step(0.02)
    assert len(spinning().run(0.2, 0.2)) > 1


def test_more_resets_or_a_larger_tolerance():
    def settled(**options):
        scene, _ = block(0.05, form="u_epsv_finite", ghost_penalty=penalty)
        return tawami.settle(scene, **options)

    penalty = "on"
    with pytest.raises(tawami.ConvergenceError, match="or use ghost_penalty='off'"):
        settled(max_resets=10)
    assert settled(max_resets=10, tolerance=0.1)
    penalty = "off"

    with pytest.raises(tawami.ConvergenceError, match="allow more resets, or a larger tolerance"):
        settled(max_resets=3)
    assert settled()
    assert settled(max_resets=3, tolerance=0.1)


@pytest.mark.parametrize(
    ("given", "advice", "change"),
    [
        ({"per_axis": 1}, "per_axis=3", {"per_axis": 3}),
        ({"per_axis": 1, **MOVES}, "ghost_penalty='on'", {"ghost_penalty": "on"}),
        ({"per_axis": 1, "basis": "bilinear"}, "per_axis=3", {"per_axis": 3}),
        ({"per_axis": 1, "basis": "biquadratic"}, "per_axis=3", {"per_axis": 3}),
        (
            {"per_axis": 1, "basis": "biquadratic"},
            "'quadratic_spline' with per_axis=2",
            {"per_axis": 2, "basis": "quadratic_spline"},
        ),
    ],
)
def test_particles_that_give_no_stiffness(given, advice, change):
    given = {"ghost_penalty": "off"} | given
    with pytest.raises(tawami.SingularError, match=f"functions of the grid.*{advice}"):
        block(**given)[0].solve()
    block(**given | change)[0].solve()


def test_advice_that_does_not_help_is_not_given():
    scene, _ = block(per_axis=1, basis="biquadratic", ghost_penalty="on")
    with pytest.raises(tawami.SingularError) as error:
        scene.solve()
    assert "ghost_penalty" not in str(error.value)
    scene, _ = block(per_axis=1, ghost_penalty="off")
    with pytest.raises(tawami.SingularError) as error:
        scene.solve()
    assert "ghost_penalty" not in str(error.value)  # at small strain full cells have no penalty
    scene, _ = block(per_axis=1, basis="bilinear", ghost_penalty="off", cells=(4, 4))
    with pytest.raises(tawami.SingularError) as error:
        scene.solve()
    assert "quadratic_spline" not in str(error.value)
    assert "ghost_penalty" not in str(error.value)  # the body fills the grid


@pytest.mark.parametrize("form", ["u_epsv", "u_p"])
def test_a_field_for_the_volume(form):
    law = tawami.linear_elastic(K=1e13, mu=1.0)
    with pytest.raises(tawami.ConvergenceError, match=f"use form .*'{form}'"):
        block(materials=[law, law], form="u")[0].solve()
    block(materials=[law, law], form=form)[0].solve()


def test_a_softer_stiff_material_or_supports():
    def materials(ratio):
        return [tawami.linear_elastic(E=E, nu=0.3) for E in (1.0, ratio)]

    with pytest.raises(
        tawami.ConvergenceError, match="make the stiff one softer, or hold all of it by supports"
    ):
        block(materials=materials(1e10))[0].solve()
    block(materials=materials(1e7))[0].solve()
    scene, upper = block(materials=materials(1e10))
    scene.load(~upper, (1e-3, -1e-3))
    for x in np.linspace(0.0, 1.0, 5):
        for y in (0.5, 0.75, 1.0):
            scene.hold((x, y), "x")
            scene.hold((x, y), "y")
    scene.solve()


@pytest.mark.filterwarnings("ignore::tawami.LockingWarning")
def test_a_factorisation_takes_over_and_names_the_cells():
    given = {"per_axis": 1, "ghost_penalty": "off"}
    with (
        pytest.raises(tawami.SingularError, match=r"weakest at the cells \(i, j\): \(\d, \d\)"),
        pytest.warns(tawami.SolverWarning, match="multigrid stalls"),
    ):
        block(**given, linear_solver="multigrid")[0].solve()


@pytest.mark.direct
def test_a_new_factorisation_of_every_tangent(monkeypatch):
    """One that is reused may not do for the second right-hand side of a path."""
    monkeypatch.setattr(linear_solver, "MOST", 2)

    def path(factorise):
        scene = pressed(0.3, 0.0, factorise=factorise)
        return tawami.follow(scene, UNDER_IT, size=5e-3, to=-0.03, stop="raise")

    with pytest.raises(tawami.SingularError, match="use factorise='always'"):
        path("when_it_pays")
    assert path("always").complete
