"""Steps from 1e-8 to 1e3 times the natural period of a bar in its first axial mode.

Reference: the trapezoidal rule turns (omega u, v) of an oscillator by 2 atan(omega dt/2) in a step,
whatever the step. In steps that damp (gamma = 1) the bar under its weight comes to rest at the
elongation rho g L^2/(2 E).
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np
from mpi4py import MPI

import tawami
from cases.extremes.attempt import Attempt, attempted

SUBJECT = "time step"
L, E, RHO = 1.0, 1.0e6, 1000.0  # [m], [Pa], [kg/m3]
OMEGA = np.pi / 2 * np.sqrt(E / RHO) / L  # [rad/s]
PERIOD = 2 * np.pi / OMEGA  # [s]
CELLS, STEPS = 16, 16
FORMS = ("u", "u_epsv", "u_finite", "u_epsv_finite", "u_bbar_finite")
#: Lumped mass and spline make the frequency of 16 cells wrong by 0.1 to 0.2 %, which grows to a phase
#: of 2 % in 16 steps near a quarter of the period: measured on cells of half the size it is a fourth.
BOUND = 0.02
#: Strains that Newton's method takes for round-off where there are no loads, a hundred times over: the
#: acceleration that comes of less is not asked for.
LEAST_STRAIN = 1e-12
#: The energy of particles differs from that of the grid by the mass in the end cells, 0.2 %.
ENERGY = 5e-3


def bar(form: str, amplitude: float, gamma: float = 0.5) -> tawami.Dynamics:
    """The bar, nu = 0, held at its left end; straight, with the velocity of its first mode [strain]."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=L / CELLS, cells=(CELLS + 2, 2))
    body = tawami.box(grid, (0, 0), (L, 2 * L / CELLS))
    options: dict[str, Any] = {"alpha": 0.0} if "epsv" in form else {}
    law = tawami.linear_elastic(E=E, nu=0.0)
    scene = tawami.Scene(grid, body, law, form=form, density=RHO, **options)
    scene.fix("left", "x")
    scene.fix("bottom", "y")
    scene.fix("top", "y")
    x, fastest = body.x[:, 0], amplitude * L * OMEGA
    wave = np.pi / (2 * L)
    velocity = fastest * np.column_stack([np.sin(wave * x), 0 * x])
    motion = tawami.Dynamics(scene, velocity=velocity, gamma=gamma)
    motion.velocity_gradient[:, 0, 0] = fastest * wave * np.cos(wave * x)
    return motion


def oscillation(form: str, ratio: float, amplitude: float = 1e-4) -> float:
    """Largest error of displacement, velocity and acceleration in the mode, over what each may reach in
    the run; beyond all bounds where energy grows.
    """
    motion = bar(form, amplitude)
    scene, dt = motion.scene, ratio * PERIOD
    shape = np.sin(np.pi * np.array(scene.particles.x)[:, 0] / (2 * L))
    weight = shape / (shape @ shape)
    start, fastest = motion.kinetic_energy, amplitude * L * OMEGA
    turned = 2 * np.arctan(OMEGA * dt / 2) * np.arange(1, STEPS + 1)
    far = np.maximum.accumulate(np.abs(np.sin(turned)))
    errors = []
    for angle, reach in zip(turned, far, strict=True):
        solution = motion.step(dt)
        u = weight @ solution.displacement_of_particles[:, 0] * OMEGA / fastest
        v = weight @ motion.velocity[:, 0] / fastest
        a = weight @ motion.acceleration[:, 0] / (fastest * OMEGA)
        errors += [abs(u - np.sin(angle)) / reach, abs(v - np.cos(angle)),
                   abs(a + np.sin(angle)) / max(reach, LEAST_STRAIN / amplitude)]  # fmt: skip
        if motion.kinetic_energy + motion.elastic_energy > (1 + ENERGY) * start:
            return np.inf
    return float(np.max(errors))


def rest(form: str, ratio: float) -> float:
    """Error of the elongation under the weight after 40 damped steps: of gamma = 1 each takes it to at
    most a third of its distance.
    """
    motion = bar(form, 0.0, gamma=1.0)
    scene = motion.scene
    expected = 1e-4 * L
    scene.gravity((2 * E * expected / (RHO * L**2), 0.0))
    for _ in range(40):
        solution = motion.step(ratio * PERIOD)
    x = np.array(scene.particles.x)[:, 0] - solution.displacement_of_particles[:, 0]
    exact = expected * (2 * x / L - (x / L) ** 2)
    return float(np.abs(solution.displacement_of_particles[:, 0] - exact).max() / expected)


def attempts(short: bool) -> Iterator[Attempt]:
    """Every form at steps of every size; small and large amplitudes; the static limit."""
    ratios = [1e-8, 1e-4, 1.0, 1e3] if short else [10.0**k for k in range(-12, 7)]
    for form in ("u", "u_epsv_finite") if short else FORMS:
        for ratio in ratios:
            yield attempted(
                SUBJECT, f"{form}, dt = {ratio:g} T", BOUND,
                partial(oscillation, form, ratio),
            )  # fmt: skip
        for ratio in (10.0, 1e3) if short else (1.0, 10.0, 100.0, 1e3):
            # the sum over the particles for the integral: second order in their distance
            yield attempted(
                SUBJECT, f"{form}, dt = {ratio:g} T, damped to rest", 2e-3,
                partial(rest, form, ratio),
            )  # fmt: skip
