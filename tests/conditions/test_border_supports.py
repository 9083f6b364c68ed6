"""Supports on borders at any place in the cells, held by tractions on patches."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI
from runs import Kill, Killed, results_of
from test_border_loads import SIZE, block, turned

import tawami

E, NU = 1e6, 0.3
ELASTIC = tawami.linear_elastic(E=E, nu=NU)


@pytest.mark.parametrize(
    # errors when the bottom of the grid held the cells: +3.8, +13, +59, +3911 %
    "gap", [0.02, 0.05, 0.1, 0.2],
)  # fmt: skip
def test_a_block_above_the_lines_of_the_grid_settles_under_its_weight(gap):
    """Confined compression; the column stands on a border `gap` above the bottom of the grid."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, -gap), h=0.25, cells=(8, 8))
    body = tawami.box(grid, (0, 0), (2, 1.5), per_axis=2)
    scene = tawami.Scene(grid, body, ELASTIC, density=1e3)
    for side, component in (("bottom", "y"), ("left", "x"), ("right", "x")):
        scene.fix(side, component)
    scene.gravity((0.0, -10.0))
    solution = scene.solve()
    exact = -1e4 * 1.5**2 / 2 / (E * (1 - NU) / ((1 + NU) * (1 - 2 * NU)))
    assert solution.displacement((1.0, 1.5))[1] == pytest.approx(exact, rel=5e-3)
    assert solution.reaction("bottom")[1] == pytest.approx(3e4, rel=1e-9)
    assert solution.iterations == 1  # as on an edge of the grid


@pytest.mark.parametrize(("angle", "shift"), [(17.0, (0.1, 0.02)), (45.0, (0.07, 0.11))])
@pytest.mark.parametrize("form", ["u", "u_epsv", "u_epsv_finite"])
def test_a_uniform_strain_that_all_sides_prescribe_is_exact(angle, shift, form):
    """Patch test, with particles that integrate the functions of the grid exactly."""
    scene, _ = block(angle, shift, gauss=True, form=form)
    gradient = 1e-3 * np.array([[1.0, -0.5], [2.0, 0.7]])
    sides = ["0", "1", "2", "3"]
    scene.fix(sides, "x", lambda x, y: gradient[0, 0] * x + gradient[0, 1] * y)
    scene.fix(sides, "y", lambda x, y: gradient[1, 0] * x + gradient[1, 1] * y)
    at_start = np.array(scene.particles.x)
    solution = scene.solve()
    moved = at_start @ gradient.T
    assert solution.displacement_of_particles == pytest.approx(moved, abs=1e-9 * moved.max())


@pytest.mark.parametrize("angle", [10.0, 17.0, 75.0])
@pytest.mark.parametrize("shift", [(0.1, 0.02), (0.013, 0.199)])
def test_rollers_on_inclined_faces_let_a_block_contract_freely(angle, shift, basis):
    """Pressed on one side, on rollers on two others: uniform stress, also in slivers of cells."""
    scene, _ = block(angle, shift, gauss=True, form="u", basis=basis)
    scene.fix("0", "normal")
    scene.fix("3", "normal")
    scene.pressure("2", 1.0)
    solution = scene.solve()
    q = turned(angle)
    expected = q @ np.diag([0.0, -1.0]) @ q.T
    sigma = solution.stress
    assert sigma[:, 0] == pytest.approx(expected[0, 0], abs=1e-8)
    assert sigma[:, 1] == pytest.approx(expected[1, 1], abs=1e-8)
    assert sigma[:, 3] == pytest.approx(expected[0, 1], abs=1e-8)
    assert q.T @ solution.reaction("0") == pytest.approx([0.0, SIZE[0]], abs=1e-9)
    assert q.T @ solution.reaction("3") == pytest.approx([0.0, 0.0], abs=1e-9)


@pytest.mark.parametrize("geometry", ["plane_strain", "axisymmetric"])
def test_reactions_on_patches_balance_the_loads(geometry):
    scene, _ = block(17.0, (0.1, 0.02), geometry, density=2.0)
    scene.fix("0", "x")
    scene.fix("0", "y")
    scene.fix("1", "normal", 1e-4)
    scene.traction("2", (0.0, -3.0))
    scene.gravity((0.0, -10.0))
    solution = scene.solve()
    n = scene.configuration.domain.layout.num_displacement
    load = scene.configuration.external()[:n].reshape(-1, 2).sum(axis=0)
    reaction = solution.reaction("0") + solution.reaction("1")
    balanced = slice(1, 2) if geometry == "axisymmetric" else slice(None)
    size = np.abs(load).max()
    assert reaction[balanced] == pytest.approx(-load[balanced], abs=1e-9 * size)


def cantilever(n, angle):
    """Sag of a cantilever of 4 m x 1 m under a shear at its tip, relative to its axes, and the
    condition number.
    """
    h = 1 / n
    q, start = turned(angle), np.array([1.03, 0.51])
    corners = np.array([(0, 0), (4, 0), (4, 1), (0, 1)]) @ q.T + start
    low, high = corners.min(axis=0), corners.max(axis=0)
    origin = low - (0.0 if angle == 0 else 0.4 * h)
    cells = np.ceil((high - origin) / h - 1e-9).astype(int)
    grid = tawami.Grid(
        MPI.COMM_WORLD, origin=tuple(origin), h=h, cells=(int(cells[0]), int(cells[1]))
    )
    body = tawami.polygon(grid, [tuple(c) for c in corners])
    scene = tawami.Scene(grid, body, ELASTIC)
    for component in ("x", "y"):
        scene.fix("3", component)
    scene.traction("1", tuple(-10.0 * q[:, 1]))
    solution = scene.solve()
    tip = start + q @ np.array([4 - 1e-9, 0.5])
    return q[:, 1] @ solution.displacement(tip), solution.condition


@pytest.mark.parametrize("angle", [10.0, 30.0, 45.0])
@pytest.mark.parametrize(
    ("n", "bound"), [(8, 0.01), pytest.param(16, 0.005, marks=pytest.mark.slow)]
)
def test_a_turned_cantilever_sags_like_a_straight_one(angle, n, bound):
    straight, _ = cantilever(n, 0.0)
    turned_one, condition = cantilever(n, angle)
    print(f"{angle:g} degrees: {turned_one / straight - 1:+.3%}, condition {condition:.3g}")
    assert turned_one == pytest.approx(straight, rel=bound)
    assert condition < 1e6


def test_supports_after_a_motion_hold_the_border_where_it_is():
    """A block flies, turns, and is then stopped at its side '0'."""
    scene, corners = block(0.0, (0.05, 0.03), form="u_epsv_finite", density=1.0)
    middle = corners.mean(axis=0)
    motion = tawami.Dynamics(
        scene, velocity=lambda x, y: (-(y - middle[1]), x - middle[0]), gamma=0.8
    )
    for _ in range(4):
        motion.step(0.1)
    before = scene.border.points.x[scene.border.points.made.tag == 0].mean(axis=0)
    scene.fix("0", "x")
    held = scene.fix("0", "y")
    for _ in range(10):
        solution = motion.step(0.1)
    after = scene.border.points.x[scene.border.points.made.tag == 0].mean(axis=0)
    assert after == pytest.approx(before, abs=2e-3)
    assert np.abs(solution.reaction("0")).max() > 0
    held.release()
    motion.step(0.1)


@pytest.mark.parametrize("way", ["released", "changed"])
def test_a_support_on_patches_is_changed_and_released_in_a_ramp(way):
    scene, _ = block(20.0, (0.05, 0.03), form="u")
    q = turned(20.0)
    for component in ("x", "y"):
        scene.fix("0", component)
    plate = scene.fix("2", "normal", -1e-3)
    first = q.T @ scene.solve().reaction("2")
    assert first[1] < -0.5
    if way == "changed":
        plate.change(-2e-3)
        found = []
        tawami.ramp(scene, 0.5, each=lambda s: found.append(q.T @ s.reaction("2")))
        assert np.array(found) == pytest.approx(np.array([1.5 * first, 2 * first]), rel=1e-4)
    else:
        plate.release()
        assert np.abs(scene.solve().stress).max() < 1e-6 * abs(first[1])


@pytest.mark.filterwarnings("ignore::tawami.EnergyWarning")
def test_a_motion_on_patches_resumes_to_the_bit(tmp_path):
    """Killed in the middle: supports that moved off the lines of the grid, and a pressure."""

    def run(folder, each=None):
        scene, _ = block(10.0, (0.05, 0.03), form="u_epsv_finite", density=1.0)
        scene.fix("0", "x", velocity=0.1)
        scene.fix("0", "normal", amplitude=lambda t: 0.01 * t)
        scene.pressure("2", 5.0, amplitude=lambda t: t)
        motion = tawami.Dynamics(scene, gamma=0.7)
        motion.run(0.3, 0.05, results=results_of(folder), each=each)
        points = scene.border.points
        return scene.particles.rows().tobytes(), points.x.tobytes(), points.area.tobytes()

    whole = run(tmp_path / "whole")
    kill = Kill(3)
    with pytest.raises(Killed):
        run(tmp_path / "killed", kill)
    assert run(tmp_path / "killed", kill) == whole


OVERLAPPING = {
    "part after all": ["left", lambda x, y: (x < 0.3) & (y > 0.37) & (y < 1.31)],
    "all after part": [lambda x, y: (x < 0.3) & (y > 0.37) & (y < 1.31), "left"],
    "two parts": [lambda x, y: (x == 0.13) & (y < 1.07), lambda x, y: (x == 0.13) & (y > 0.41)],
}


def overlapping(first, second, values=(0.0, 0.0), form="u_epsv"):
    """A block whose left side is between two lines of the grid, held there by two supports."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=0.25, cells=(8, 8))
    block = tawami.box(grid, (0.13, 0), (1.75, 1.62), per_axis=3)
    law = tawami.linear_elastic(E=1e6, nu=0.3)
    scene = tawami.Scene(grid, block, law, form=form, ghost_penalty="on")
    scene.fix("bottom", "y")
    scene.fix(first, "x", values[0])
    scene.fix(second, "x", values[1])
    scene.traction("right", (1e4, 0.0))
    return scene


@pytest.mark.parametrize("form", ["u_epsv", "u_epsv_finite"])
@pytest.mark.parametrize("case", OVERLAPPING)
def test_supports_that_overlap_and_agree_act_as_one(case, form):
    """The stretch is that of plane strain under the traction, and the reaction balances it."""
    two = overlapping(*OVERLAPPING[case], form=form)
    solution = two.solve()
    assert solution.reaction("left")[0] == pytest.approx(-1e4 * 1.62, rel=1e-5)
    exact = 1e4 * 1.619 * (1 - 0.3**2) / 1e6
    tip = solution.displacement((1.749, 0.8))[0]
    assert tip == pytest.approx(exact, rel=2e-2 if "finite" in form else 1e-3)
    one = overlapping("left", "left", form=form).solve()
    assert tip == pytest.approx(one.displacement((1.749, 0.8))[0], rel=1e-3)


def test_supports_that_overlap_and_differ_raise():
    part = lambda x, y: (x < 0.3) & (y > 0.37) & (y < 1.31)  # noqa: E731
    with pytest.raises(tawami.SupportError, match="differ by 0.001 m where they meet"):
        overlapping("left", part, (0.0, 1e-3)).solve()


@pytest.mark.parametrize("value", [0.0, 1e-3])
def test_a_third_direction_on_a_slanted_side_agrees_or_is_rejected(value):
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=0.25, cells=(6, 6))
    block = tawami.polygon(grid, [(0.2, 0.2), (1.2, 0.4), (1.0, 1.3)], per_axis=2)
    scene = tawami.Scene(grid, block, tawami.linear_elastic(E=1e6, nu=0.3), form="u_epsv")
    for component in ("x", "y"):
        scene.fix("0", component, 1e-3)
    side = np.array([1.0, 0.2])
    normal = np.array([0.2, -1.0]) / np.linalg.norm(side)
    scene.fix("0", "normal", value + normal @ (1e-3, 1e-3))
    if value:
        with pytest.raises(
            tawami.SupportError, match="x = 0.001 m, .* differ by 0.001 m where they"
        ):
            scene.solve()
        return
    assert scene.solve().displacement((0.9, 0.8)) == pytest.approx([1e-3, 1e-3], rel=1e-9)


def test_supports_side_by_side_may_differ():
    def above(x, y):
        return (x == 0.13) & (y > 0.81)

    def below(x, y):
        return (x == 0.13) & (y <= 0.81)

    solution = overlapping(above, below, (0.0, 1e-4)).solve()
    assert solution.reaction("left")[0] == pytest.approx(-1e4 * 1.62, rel=1e-6)
