"""A drop that falls and bounces: mass, axial momentum, hoop stretch."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

import tawami

G, SPEED, RADIUS = 9.81, 2.0, 0.45


def drop(form, nu, transfer):
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=0.15, cells=(6, 9), geometry="axisymmetric")
    body = tawami.disc(grid, (0, 0.75), RADIUS, per_axis=2)
    material = tawami.linear_elastic(E=1e5, nu=nu)
    scene = tawami.Scene(grid, body, material, form=form, density=1000.0, tolerance=1e-10)
    return scene, tawami.Dynamics(scene, velocity=(0.0, -SPEED), transfer=transfer)


@pytest.mark.parametrize(
    "form", [pytest.param("u_finite", marks=pytest.mark.slow), "u_epsv_finite"]
)
def test_a_drop_falls_and_bounces_with_its_momentum(form):
    scene, motion = drop(form, 0.3 if form == "u_finite" else 0.45, "affine_flip")
    scene.gravity((0.0, -G))
    scene.wall("bottom")
    mass = scene.mass.sum()
    assert mass == pytest.approx(4 / 3 * np.pi * RADIUS**3 * 1000, rel=1e-12)
    start, impulses = np.array(scene.particles.x), [0.0]

    def record(solution):
        impulses.append(impulses[-1] + 0.01 * solution.reaction("bottom")[1])

    motion.run(0.05, 0.01)
    fall = -mass * (SPEED + G * 0.05)
    assert motion.linear_momentum == pytest.approx([0.0, fall], rel=1e-9)
    motion.run(0.4, 0.01, each=record)
    bounced = motion.linear_momentum[1]
    assert bounced > 0.6 * mass * SPEED
    # reactions are those at the ends of steps; on the next grid the first one differs a little
    assert bounced - fall == pytest.approx(impulses[-1] - mass * G * 0.35, rel=0.012)
    # the hoop stretch of a particle is the change of its radius, whatever happened in between
    x, f = np.array(scene.particles.x), np.array(scene.particles.displacement_gradient)
    np.testing.assert_allclose(1 + f[:, 2, 2], x[:, 0] / start[:, 0], rtol=1e-6)
    assert x[:, 0].min() > 0


@pytest.mark.parametrize("transfer", ["affine_flip", "flip"])
def test_a_free_drop_keeps_its_axial_momentum(transfer):
    scene, motion = drop("u_finite", 0.3, transfer)
    x = np.array(scene.particles.x)
    motion.velocity[:] += np.column_stack([0.5 * x[:, 0], np.sin(5 * x[:, 1])])
    before = motion.linear_momentum
    motion.run(0.1, 0.01)
    assert motion.linear_momentum == pytest.approx(before, rel=1e-9)
    assert before[0] == 0.0
