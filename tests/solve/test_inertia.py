"""Inertia in very short and very long steps: no digits of the acceleration are lost."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

import tawami

L, E, RHO = 1.0, 1e6, 1000.0
OMEGA = np.pi / 2 * np.sqrt(E / RHO) / L


@pytest.mark.parametrize("form", ["u", "u_epsv_finite"])
@pytest.mark.parametrize("angle", [1e-9, 1e-7, 1e-5, 1e-3, 1.0, 1e4])
def test_the_acceleration_of_a_vibrating_bar(form, angle):
    """First axial mode, nu = 0. The trapezoidal rule turns (omega x, v) by 2 atan(omega dt/2) in a step
    of any size; the acceleration is -omega^2 times the displacement.
    """
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=1 / 16, cells=(18, 2))
    body = tawami.box(grid, (0, 0), (L, 1 / 8), per_axis=2)
    options = {} if form == "u" else {"alpha": 0.0}
    law = tawami.linear_elastic(E=E, nu=0.0)
    scene = tawami.Scene(grid, body, law, form=form, density=RHO, **options)
    for edge, component in (("left", "x"), ("bottom", "y"), ("top", "y")):
        scene.fix(edge, component)
    x, v0 = body.x[:, 0], 1e-4 * L * OMEGA
    shape = np.sin(np.pi * x / (2 * L))
    motion = tawami.Dynamics(scene, velocity=v0 * np.column_stack([shape, 0 * shape]))
    motion.velocity_gradient[:, 0, 0] = v0 * np.pi / (2 * L) * np.cos(np.pi * x / (2 * L))
    for _ in range(3):
        motion.step(angle / OMEGA)
    turned = 3 * 2 * np.arctan(angle / 2)
    weight = shape / (shape @ shape)
    assert weight @ motion.velocity[:, 0] == pytest.approx(v0 * np.cos(turned), abs=0.01 * v0)
    acceleration = -OMEGA * v0 * np.sin(turned)
    largest = OMEGA * v0 * min(1.0, abs(turned))
    assert weight @ motion.acceleration[:, 0] == pytest.approx(acceleration, abs=0.01 * largest)


@pytest.mark.parametrize("dt", [1e-13, 1e-11, 1e-9, 1e-6])
def test_gravity_acts_on_a_fast_body_in_a_short_step(dt):
    """A step of 1e-13 s at 1 km/s changes the velocity in its last digit only."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(-1, -1), h=0.125, cells=(16, 16))
    body = tawami.box(grid, (-0.25, -0.25), (0.25, 0.25), per_axis=2)
    law = tawami.linear_elastic(E=1e5, nu=0.3)
    scene = tawami.Scene(grid, body, law, form="u_epsv_finite", density=1000.0)
    scene.gravity((0.0, -10.0))
    motion = tawami.Dynamics(scene, velocity=(1000.0, 0.0))
    motion.step(dt)
    assert motion.acceleration == pytest.approx(np.tile([0.0, -10.0], (64, 1)), abs=1e-6)


@pytest.mark.parametrize("dt", [1e-300, 1e-101, 1e101, 1e300])
def test_a_step_whose_square_overflows_is_rejected(dt):
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(-1, -1), h=0.125, cells=(16, 16))
    body = tawami.box(grid, (-0.25, -0.25), (0.25, 0.25), per_axis=2)
    law = tawami.linear_elastic(E=1e5, nu=0.3)
    scene = tawami.Scene(grid, body, law, form="u_epsv_finite", density=1000.0)
    motion = tawami.Dynamics(scene)
    for act in (lambda: motion.step(dt), lambda: motion.run(1e301, dt)):
        with pytest.raises(tawami.InputError, match="of at least 1e-100 and at most 1e.100"):
            act()
    motion.velocity[:] = (1.0, 2.0)
    velocity = np.zeros((64, 2))
    velocity[5, 1] = np.inf
    with pytest.raises(tawami.InputError, match=r"velocity of particle 5 is \(0, inf\) m/s"):
        tawami.Dynamics(scene, velocity=velocity)
    assert (motion.velocity == (1.0, 2.0)).all()
