"""A body that oscillates on springs of its border, `sum_b`, and its balance of energy."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI
from ufl import dot

import tawami
from tawami.form import Form, vector


def on_springs(u, w, P, old, grad, sum_p, sum_b, k):
    return sum_p(P, grad(w)) + sum_b(k * dot(old.u + u, w), on="bottom")


def test_a_stiff_body_on_springs_oscillates_and_keeps_its_energy():
    """u = -g m/k (1 - cos(omega t)), omega^2 = k/m; particles stay in their cells."""
    k, m, g, steps, dt = 3200.0, 100.0, 1.0, 16, 0.02
    form = Form(
        {"u": vector("w")}, on_springs, strain="finite",
        parameters={"k": {"default": k, "unit": "Pa/m"}},
    )  # fmt: skip
    grid = tawami.Grid(MPI.COMM_SELF, origin=(0, 0), h=0.5, cells=(2, 4))
    body = tawami.box(grid, (0, 0.5), (1, 1.5), per_axis=3)
    stiff = tawami.linear_elastic(E=1e6, nu=0.0)
    scene = tawami.Scene(grid, body, stiff, form=form, density=m)
    scene.fix("left", "x")
    scene.gravity((0.0, -g))
    motion = tawami.Dynamics(scene)
    for _ in range(steps):
        motion.step(dt)
    u = np.asarray(scene.particles.displacement)[:, 1].mean()
    assert u == pytest.approx(-g * m / k * (1 - np.cos(np.sqrt(k / m) * steps * dt)), rel=0.02)
    energies = motion.energies
    left = -m * g * u - k * u**2 / 2  # kinetic energy of the closed form
    assert energies.external == pytest.approx(left, abs=0.01 * m * g * abs(u))
    assert abs(energies.integration) < 0.02 * m * g * abs(u)
