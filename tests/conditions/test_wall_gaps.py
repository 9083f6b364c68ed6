"""Walls at a distance from the body: contact starts where the gap closes."""

from __future__ import annotations

import re
import warnings

import numpy as np
import pytest
from mpi4py import MPI

import tawami

RHO, G, H = 1000.0, 10.0, 0.125
LAW = tawami.linear_elastic(E=1e6, nu=0.3)


def above(gap, form="u_epsv_finite", *, border=True, edge="bottom"):
    """A block above the lower edge of the grid, or beside the left one, by a gap [m]."""
    low, high = np.array([0.25, gap]), np.array([0.75, gap + 0.5])
    if edge == "left":
        low, high = low[::-1], high[::-1]
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=H, cells=(8, 8))
    body = tawami.box(grid, low, high, per_axis=2)
    if not border:
        body = tawami.Body(body.x, body.volume)
    scene = tawami.Scene(grid, body, LAW, form=form, density=RHO)
    scene.gravity((0.0, -G) if edge == "bottom" else (-G, 0.0))
    return scene


@pytest.mark.parametrize(
    ("gap", "form", "edge"),
    [
        (0.03, "u_epsv_finite", "bottom"),
        (0.5 * H, "u_epsv_finite", "left"),
        (0.03, "u_epsv", "left"),
    ],
)
def test_a_falling_block_touches_when_the_gap_closes(gap, form, edge):
    """It falls for sqrt(2 gap/g). Each step keeps the balance of momentum, and adds no energy."""
    scene, dt, axis = above(gap, form, edge=edge), 2e-3, 1 if edge == "bottom" else 0
    scene.wall(edge, 0.3)
    motion = tawami.Dynamics(scene)
    mass, fall = scene.mass.sum(), np.sqrt(2 * gap / G)
    exact = 1e-6 if form == "u_epsv" else 2e-3  # where particles move, transfers change momentum
    pushed, momentum, energy = [], [0.0], [0.0]

    def look(solution):
        force = solution.reaction(edge)[axis]
        pushed.append(motion.time if force > 0 else np.inf)
        momentum.append(motion.linear_momentum[axis])
        change = dt * (force - mass * G)
        assert momentum[-1] - momentum[-2] == pytest.approx(
            change, rel=exact, abs=exact * mass * G * dt
        )
        e = motion.energies
        energy.append(e.kinetic + e.elastic - e.external)
        assert max(energy) < 1e-3 * mass * G * gap

    motion.run((round(fall / dt) + 12) * dt, dt, each=look)
    assert min(pushed) == pytest.approx(fall, abs=1.5 * dt)


def test_in_statics_a_block_over_a_gap_is_not_held():
    scene = above(0.3 * H)
    scene.wall("bottom")
    with pytest.raises(tawami.SupportError, match="free to move: .*translation in y"):
        scene.solve()


def test_a_corner_that_lands_on_a_wall_stays_in_the_grid():
    """Its patches touch by their means, so that particles next to the corner pass the wall a little."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=H, cells=(10, 10))
    corners = [(0.6, 0.01), (0.95, 0.36), (0.6, 0.71), (0.25, 0.36)]
    body = tawami.polygon(grid, corners, per_axis=3)
    scene = tawami.Scene(grid, body, LAW, form="u_epsv_finite", density=RHO, ghost_penalty="on")
    scene.gravity((0.0, -G))
    scene.wall("bottom", 0.2)
    motion = tawami.Dynamics(scene, velocity=(0.0, -0.5), gamma=0.6)
    lowest = []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", tawami.SupportWarning)  # as of any corner that is so deep
        motion.run(0.1, 5e-3, each=lambda solution: lowest.append(solution.x[:, 1].min()))
    assert -0.4 * H < min(lowest) < 0
    assert motion.linear_momentum[1] > 0


@pytest.mark.parametrize("gap", [0.0, 0.4 * H])
def test_a_wall_tells_loose_particles_of_a_distance(gap):
    """With the border of the message it waits."""
    scene = above(gap, border=False)
    if not gap:
        scene.wall("bottom", 0.2)
        tawami.Dynamics(scene, velocity=(0.5, 0.0)).run(0.01, 5e-3)
        return
    with pytest.warns(tawami.SupportWarning, match="the wall acts already") as caught:
        scene.wall("bottom", 0.2)
    [advice] = re.findall(r"Body\(x, volume, (border=.*)\), for", str(caught[0].message))
    corners = [(0.25, gap), (0.75, gap), (0.75, gap + 0.5), (0.25, gap + 0.5)]
    border = eval(advice.removeprefix("border="), {"tawami": tawami, "corners": corners})
    x, volume = scene.particles.x, scene.particles.volume
    body = tawami.Body(np.array(x), np.array(volume), border=border)
    scene = tawami.Scene(scene.grid, body, LAW, form="u_epsv_finite", density=RHO)
    scene.wall("bottom", 0.2)


def test_a_loose_particle_that_falls_is_stopped_at_a_distance():
    scene = above(1.5 * H, border=False)
    scene.wall("bottom")
    with pytest.warns(tawami.SupportWarning, match="the wall pushed them in a step"):
        tawami.Dynamics(scene, velocity=(0.0, -1.0)).run(0.2, 1e-2)
