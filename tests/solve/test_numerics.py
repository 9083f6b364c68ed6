"""Numerical settings change the time of a step, not its result."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

import tawami
from cases.verification.cantilever import mpm


def pushed(**options) -> tawami.Scene:
    """A block that yields and needs several Newton iterations."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0.0, 0.0), h=0.25, cells=(6, 4))
    body = tawami.box(grid, (0.0, 0.0), (1.0, 1.0), per_axis=2)
    clay = tawami.von_mises(tawami.linear_elastic(E=1e7, nu=0.49), yield_stress=1e5, hardening=1e5)
    scene = tawami.Scene(grid, body, clay, form="u_epsv", alpha=0.1, **options)
    scene.fix("bottom", "x")
    scene.fix("bottom", "y")
    scene.fix("left", "x")
    scene.fix("top", "y", lambda x, y: -0.02 * x)
    return scene


@pytest.mark.parametrize("form", ["u", "u_bbar", "u_epsv", "u_p"])
def test_multigrid_agrees_with_the_direct_solver(form):
    rubber = tawami.linear_elastic(
        E=3e6, nu=0.45
    )  # near 0.5 multigrid fails without a field for volume
    direct, iterative = (
        mpm.build(form, "paper", 8, material=rubber, linear_solver=name, tolerance=1e-10).solve()
        for name in ("direct", "multigrid")
    )
    assert np.allclose(iterative.u, direct.u, rtol=0, atol=1e-7 * np.abs(direct.u).max())
    assert min(iterative.krylov) > 0
    assert direct.condition / 3 < iterative.condition < 3 * direct.condition


def test_fgmres_iterations_of_the_mixed_form_are_bounded():
    def most(n: int, nu: float) -> int:
        rubber = tawami.linear_elastic(E=3e6, nu=nu)
        options = {"alpha": 0.1, "material": rubber, "linear_solver": "multigrid"}
        return max(mpm.build("u_epsv", "exact", n, **options).solve().krylov)

    assert max(most(n, nu) for n in (8, 32) for nu in (0.3, 0.4999, 0.4999999)) < 60


@pytest.mark.parametrize("solver", ["direct", "multigrid"])
def test_a_tolerance_below_round_off(solver):
    def solve(tolerance: float) -> tawami.Solution:
        return mpm.build("u_epsv", "paper", 16, linear_solver=solver, tolerance=tolerance).solve()

    with pytest.raises(tawami.ConvergenceError, match="expected a tolerance of") as error:
        solve(1e-14)
    expected = float(str(error.value).split("tolerance of ")[1].split(" or")[0])
    assert expected < 1e-10
    solve(expected)


@pytest.mark.direct
def test_a_factorisation_in_every_iteration_gives_the_same_solution():
    seldom, always = (pushed(factorise=when).solve() for when in ("when_it_pays", "always"))
    assert always.krylov == (0,) * always.iterations
    assert max(seldom.krylov) > 0
    assert np.allclose(always.u, seldom.u, rtol=0, atol=1e-6 * np.abs(seldom.u).max())


def test_a_system_that_multigrid_cannot_solve():
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0.0, 0.0), h=0.5, cells=(4, 2))
    body = tawami.box(grid, (0.0, 0.0), (2.0, 1.0), per_axis=1)
    scene = tawami.Scene(
        grid, body, tawami.linear_elastic(E=1e6, nu=0.3), form="u", basis="biquadratic",
        linear_solver="multigrid",
    )  # fmt: skip
    scene.fix("left", "x")
    scene.fix("left", "y")
    scene.traction("right", (0.0, -1.0))
    with (
        pytest.raises(tawami.SingularError, match="weakest at the cells"),
        pytest.warns(tawami.SolverWarning, match="multigrid stalls"),
    ):
        scene.solve()
    assert not scene.particles.stress.any()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (
            {"linear_solver": "cg"},
            "linear_solver = 'cg': expected one of 'auto', 'direct', 'multigrid'",
        ),
        ({"linear_solver": "iterative"}, "it is called 'multigrid' now; expected one of"),
        ({"factorise": "never"}, "factorise = 'never': expected 'when_it_pays' or 'always'"),
        ({"tolerance": 0.5}, "tolerance = 0.5: expected a finite number"),
    ],
)
def test_wrong_settings_are_rejected(options, message):
    with pytest.raises(tawami.InputError, match=message):
        pushed(**options)
