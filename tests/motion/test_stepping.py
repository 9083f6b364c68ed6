"""Adaptive steps, ramps, and the equilibrium at rest."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI
from scenes import grid_of

import tawami
from tawami.conditions.activity import Activity
from tawami.motion.observer import NullObserver
from tawami.motion.pace import Pace, Step, pack, unpack
from tawami.motion.stepping import march

ELASTIC = tawami.linear_elastic(E=100.0, nu=0.3)


class Answer:
    """The attributes of a step that `march` reads."""

    history = ((1.0, None), (1e-9, None))
    krylov = (0,)


def refusing(limit, calls):
    def attempt(_target, size):
        calls.append(size)
        if size > limit(_target):
            raise tawami.ConvergenceError("too large", [])
        return Answer()

    return attempt


def test_sizes_are_halved_on_failure_and_grow_after_three():
    calls = []
    steps = march(
        Pace(0.0, 0.25), 1.0, 1e-3, refusing(lambda _: 0.1, calls), NullObserver("s"), Activity()
    )
    assert calls[:4] == [0.25, 0.125, 0.0625, 0.0625]
    assert 0.125 in calls[4:]  # a larger size is tried again
    assert steps[-1].end == 1.0
    assert sum(step.size for step in steps) == pytest.approx(1.0)
    assert all(step.size <= 0.1 and step.iterations == 1 for step in steps)


def test_the_error_at_the_smallest_size_names_the_time():
    with pytest.raises(tawami.ConvergenceError) as error:
        march(
            Pace(0.0, 0.5),
            1.0,
            0.1,
            refusing(lambda end: 0.0 if end > 0.6 else 1.0, []),
            NullObserver("s"),
            Activity(),
        )
    assert error.value.__notes__ == ["at 0.5 s, with the smallest step of 0.125 s"]


@pytest.mark.parametrize(("size", "count"), [(0.3, 4), (0.1, 10), (1.0, 1)])
def test_the_end_is_met_exactly_without_a_tiny_step(size, count):
    steps = march(
        Pace(0.0, size), 1.0, 0.0, refusing(lambda _: 1.0, []), NullObserver("s"), Activity()
    )
    assert len(steps) == count
    assert steps[-1].end == 1.0


def block(form="u_epsv_finite", **options):
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=0.25, cells=(6, 4))
    body = tawami.box(grid, (0, 0), (1, 1), per_axis=2)
    scene = tawami.Scene(grid, body, ELASTIC, form=form, density=1.0, **options)
    scene.fix("bottom", "y")
    scene.fix("left", "x")
    return scene


@pytest.mark.parametrize("form", ["u_epsv_finite", "u_epsv"])
def test_a_ramp_applies_new_loads_in_shares(form):
    scene = block(form)
    tops = []
    scene.gravity((0.0, -2.0))
    for _ in range(2):
        tawami.ramp(scene, 0.25, each=lambda s: tops.append(s.reaction("bottom")[1]))
        scene.load(scene.particles.x[:, 1] > 0.8, (0.0, -4.0))
    assert tops == pytest.approx([0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0], rel=1e-4)
    assert scene.solve().reaction("bottom")[1] == pytest.approx(10.0, rel=1e-4)


def test_a_prescribed_displacement_is_applied_once():
    """In finite strain too, in any number of steps."""
    for steps in (1, 5):
        scene = block()
        scene.fix("top", "y", -0.05)
        tawami.ramp(scene, 1 / steps)
        shortened = np.array(scene.particles.displacement)
        # particles that have left the edge a little are held less by its functions
        assert shortened[:, 1].min() == pytest.approx(-0.05 * 0.9375, rel=0.02 * steps)
        scene.solve()  # it is not applied again
        assert scene.particles.displacement == pytest.approx(shortened, abs=0.01)


def test_a_ramp_stops_at_the_limit_load():
    """A von Mises block in uniform shortening under a dead load: the limit is 2/sqrt(3) sigma_y."""
    grid = grid_of((4, 2))
    body = tawami.box(grid, grid.origin, grid.upper, per_axis=3, gauss=True)
    law = tawami.von_mises(ELASTIC, yield_stress=1.0)
    scene = tawami.Scene(grid, body, law, form="u_epsv")
    scene.fix("left", "x")
    scene.fix("bottom", "y")
    push = scene.traction("right", (-2.0, 0.0))
    with pytest.warns(
        tawami.IncompleteWarning, match="ramp stopped at .* of the load, with the small"
    ):
        steps = tawami.ramp(scene, 0.1, smallest=1e-3)
    reached = scene.particles.stress[:, 0].mean() / -2.0
    assert reached == pytest.approx(1 / np.sqrt(3), rel=0.01)
    assert steps.reached == pytest.approx(reached)
    assert not steps.complete
    assert steps.loads == [step.end for step in steps]
    with pytest.raises(tawami.ConvergenceError) as error:
        tawami.ramp(scene, 0.1, smallest=1e-2, stop="raise")
    assert "of the load, with the smallest step" in error.value.__notes__[0]
    push.release()
    assert scene.solve().reaction("left") == pytest.approx([0.0, 0.0], abs=1e-6)


def test_settle_needs_finite_strain_and_ends_after_max_resets():
    with pytest.raises(tawami.InputError, match="expected a scene with a form of finite strain"):
        tawami.settle(block("u"))
    scene = block()
    scene.gravity((0.0, -20.0))
    with pytest.raises(tawami.ConvergenceError, match="out of balance after 1 resets of the grid"):
        tawami.settle(scene, max_resets=1)
    assert tawami.settle(scene)[-1].history[0][0] < 1e-10


def test_reactions_balance_the_weight():
    scene = block("u")
    scene.release("bottom")
    scene.hold((0.3, 0.4), "y")
    scene.hold((0.8, 0.4), "y")
    scene.gravity((0.0, -2.0))
    solution = scene.solve()
    left, right = (solution.reaction((x, 0.4)) for x in (0.3, 0.8))
    assert left[1] + right[1] == pytest.approx(2.0)
    # moments about the left edge: its reactions there have no lever but their own
    assert right[1] > left[1] * 0.1
    assert left[0] == right[0] == 0.0
    with pytest.raises(
        tawami.InputError, match=r"reaction\(\(0.5, 0.5\)\): no point is held there"
    ):
        solution.reaction((0.5, 0.5))
    with pytest.raises(tawami.InputError, match=r"reaction\('floor'\): .*expected one of 'left'"):
        solution.reaction("floor")


def test_an_edge_and_a_point_near_it_share_the_load():
    """The functions of the edge reach the point, and its reaction is not counted twice."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=0.25, cells=(8, 4))
    body = tawami.box(grid, (0, 0), (2, 1), per_axis=2)
    scene = tawami.Scene(grid, body, ELASTIC, form="u")
    scene.fix("left", "x")
    scene.hold((0, 0.5), "y")
    scene.traction("right", (0.0, -2.0))
    solution = scene.solve()
    assert solution.reaction("left") == pytest.approx([0.0, 0.0], abs=1e-5)
    assert solution.reaction((0, 0.5)) == pytest.approx([0.0, 2.0], rel=1e-5)


def test_a_support_that_leaves_its_edge_moves_the_border():
    """It is held on patches from then on, by more than a quarter of a cell."""
    scene = block()
    scene.fix("top", "y", -0.1)
    tawami.ramp(scene, 0.25)
    border = scene.border.points
    top = border.made.tag == border.made.names.index("top")
    moved = border.x[top, 1] - border.first.x[top, 1]
    assert moved @ border.length[top] / border.length[top].sum() == pytest.approx(-0.1, abs=1e-6)


def test_a_held_point_moves_with_the_body():
    """By half a cell: its cell has lost its particles. It is found by its old and its new place."""
    scene = block()
    scene.configuration.supports.all.clear()
    points = [(0.999, 0.1), (0.999, 0.9)]
    for point in points:
        scene.hold(point, "x", 0.2)
    scene.hold((0.5, 0.5), "y")
    steps = tawami.ramp(scene, 0.1)
    assert len(steps) == 10
    assert steps.complete
    assert steps.reached == 1.0
    assert scene.particles.displacement[:, 0] == pytest.approx(np.full(64, 0.2), abs=1e-8)
    solution = scene.solve()
    x, y = scene.configuration.supports.all[0].place
    assert (x, y) == pytest.approx((1.199, 0.1), abs=1e-8)
    for place in (points[0], (x, y)):
        assert solution.reaction(place) == pytest.approx([0.0, 0.0], abs=1e-6)
    scene.release(points[0])


def test_wrong_input_is_rejected():
    scene = block()
    with pytest.raises(tawami.InputError, match="size = 2.0: expected a finite number above 0"):
        tawami.ramp(scene, 2.0)
    scene.fix("right", "x", velocity=1.0)
    with pytest.raises(tawami.InputError, match=r"fix\('right'\) has a velocity, which static"):
        tawami.ramp(scene)


@pytest.mark.parametrize("more", [(), (2e-3,)])
def test_stored_steps_are_read_again(more):
    """Two measures, and a third one with fields without a role."""
    history = [(1.0, None, *more), (1e-7, None, *more)]
    steps = [Step(0.5, 0.5, history, (0,)), Step(1.0, 0.5, history[:1], ())]
    assert unpack(pack(steps)) == steps
    volume = [Step(0.5, 0.5, [(1.0, 0.3, *more)], (0,))]
    assert unpack(pack(volume)) == volume
