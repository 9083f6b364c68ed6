"""The line search: where it makes Newton converge, and that it does nothing elsewhere."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from limit_loads import pressed, pulled

import tawami
from tawami import _rust
from tawami.base.timing import tally
from tawami.solve import line_search
from tawami.solve.equations import Equations
from tawami.solve.line_search import LineSearch

#: A static step without contact.
STATIC = Equations(None, np.zeros(1), None, None, None)


def solves(nu: float, up: float) -> tuple[int, int, int]:
    """Steps, linear solves and shortened iterations of a ramp in steps of at most 1/20."""
    scene = pulled(nu, up)
    tally.reset()
    steps = tawami.ramp(scene, 0.05)
    assert steps[-1].end == 1.0
    return len(steps), tally.newton_iterations, tally.line_searches


@pytest.mark.parametrize("nu", [0.3, 0.49])
def test_a_block_in_tension_needs_a_third_of_the_solves(nu, monkeypatch):
    steps, count, searched = solves(nu, 0.04)
    assert steps <= 25  # hardly any step failed
    assert count < 350
    assert searched > 20
    monkeypatch.setattr(line_search, "OVERSHOT", np.inf)
    steps, without, _ = solves(nu, 0.04)
    assert steps > 35
    assert without > 3 * count
    print(f"nu = {nu}: {count} solves; without line search {without} in {steps}")


def iterations(scene: tawami.Scene, smallest: float) -> dict[float, int]:
    """Linear solves of each accepted step of a ramp, by the share of the load at its end."""
    steps = tawami.ramp(scene, 0.05, smallest=smallest)
    return {round(step.end, 9): len(step.history) - 1 for step in steps}


@pytest.mark.filterwarnings("ignore::tawami.base.errors.IncompleteWarning")
@pytest.mark.parametrize(("nu", "psi"), [(0.3, 0.0), (0.3, 20.0), (0.49, 10.0), (0.49, 20.0)])
def test_at_a_limit_load_it_costs_no_iteration(nu, psi, monkeypatch):
    """Every step that converges without the search converges with it, as fast."""
    tally.reset()
    found = iterations(pressed(nu, psi), 0.01)
    assert tally.line_searches > 0  # of the steps beyond the limit load
    monkeypatch.setattr(line_search, "OVERSHOT", np.inf)
    without = iterations(pressed(nu, psi), 0.01)
    assert max(without) < 1.0
    assert max(found) >= max(without)
    assert all(found[end] <= count for end, count in without.items())
    with_search = sum(found[end] for end in without)
    print(f"nu = {nu}, psi = {psi}: {with_search} iterations, without {sum(without.values())};")
    print(f"{max(found):g} of the load, without {max(without):g}")


@pytest.mark.parametrize("nu", [0.3, 0.49])
def test_where_a_block_in_tension_converges_without_it_it_costs_no_iteration(nu, monkeypatch):
    found = iterations(pulled(nu, 0.006), 0.01)
    monkeypatch.setattr(line_search, "OVERSHOT", np.inf)
    without = iterations(pulled(nu, 0.006), 0.01)
    assert list(found) == list(without)
    assert sum(found.values()) <= sum(without.values())
    print(
        f"nu = {nu}: {sum(found.values())} iterations with the search, {sum(without.values())} without"
    )


def test_a_run_that_does_not_overshoot_is_the_same_to_the_bit(monkeypatch):
    scene = pulled(0.49, 0.005)
    tally.reset()
    tawami.ramp(scene, 0.05)
    assert tally.newton_iterations > 60  # it yields
    assert tally.line_searches == 0
    stress = np.array(scene.particles.stress)
    monkeypatch.setattr(line_search, "OVERSHOT", np.inf)
    scene = pulled(0.49, 0.005)
    tawami.ramp(scene, 0.05)
    assert np.array_equal(scene.particles.stress, stress)


def advanced(work, search=None, rose=True):
    """Shares of a step that are tried, of which the last is taken, where the residual is work(share)."""
    if search is None:
        one = np.ones(1)
        search = LineSearch(np.dot, one, -one, one, STATIC, 0)
    tried = []

    def evaluate(share):
        tried.append(share)
        return SimpleNamespace(residual=np.atleast_1d(work(share))), (0.0, None)

    forces, _ = search.advance(evaluate, lambda _: rose)
    assert np.array_equal(forces.residual, np.atleast_1d(work(tried[-1])))
    return tried


def test_the_secant_method_ends_where_the_work_is_half_as_large():
    """g(t) = -1 + 3 t^3 along one coefficient: g(1) = 2, and the search stops at |g| <= 1/2."""
    tried = advanced(lambda t: -1 + 3 * t**3)
    assert abs(-1 + 3 * tried[-1] ** 3) <= 0.5
    assert len(tried) <= 5
    for work in (lambda t: -1 + 1.7 * t, lambda t: -1 - t):
        assert advanced(work) == [1.0]
    assert advanced(lambda t: -1 + 3 * t, rose=False) == [1.0]


def test_the_search_ends_after_twelve_evaluations_and_takes_no_tiny_step():
    """A work that never falls: the step is shortened to 1/200 at most."""
    tried = advanced(lambda _: 2.0)
    assert tried[-1] >= 0.005
    assert len(tried) <= 13


def test_the_search_finds_a_patch_that_closes_early():
    """g(t) = -1 until a patch closes at t = 0.02, and a slope of 200 from there."""
    tried = advanced(lambda t: -1 + 200 * max(t - 0.02, 0.0))
    assert tried[-1] == pytest.approx(0.025, abs=0.0025)


def test_a_step_that_inverts_a_particle_is_halved():
    def work(t):
        if t > 0.3:
            raise _rust.InvertedError
        return -1.0

    assert advanced(work) == [1.0, 0.5, 0.25]
    with pytest.raises(_rust.InvertedError):
        advanced(lambda t: work(max(t, 0.4)))


def test_the_volume_counts_with_the_other_sign():
    """At a saddle point, a change of eps_v that lowers the energy is one in the wrong direction."""
    change, residual, signs = np.array([[1.0, 1.0], [-2.0, 1.0], [1.0, -1.0]])
    search = LineSearch(np.dot, change, residual, signs, STATIC, 0)
    # g(0) = -3, g(1) = 3
    assert len(advanced(lambda t: np.array([-3.0, 0.0]) + t * np.array([3.0, -3.0]), search)) > 1
