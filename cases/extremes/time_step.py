"""Steps from 1e-12 to 1e6 times the natural period of a bar in its first axial mode.

The trapezoidal rule turns (omega u, v) of an oscillator by 2 atan(omega dt/2) in a step, for any step
size. With damped steps (gamma = 1) the bar comes to rest under its weight, at the elongation
rho g L^2/(2 E).
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
#: Lumped mass and splines change the frequency by 0.1 to 0.2 % at 16 cells. This grows to a phase of 2 %
#: in 16 steps near a quarter of the period. With cells of half the size it is a quarter of that.
BOUND = 0.02
#: A hundred times the strain that Newton's method takes for round-off without loads. Accelerations that
#: belong to smaller strains are not checked.
LEAST_STRAIN = 1e-12
#: The energies of particles and grid differ by the mass in the end cells, 0.2 %.
ENERGY = 5e-3


def bar(form: str, amplitude: float, gamma: float = 0.5) -> tawami.Dynamics:
    """The undeformed bar, held at its left end, with the velocity of its first mode.

    Args:
        form: Weak form.
        amplitude: Of the oscillation, as a strain.
        gamma: Of Newmark's method.
    """
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=L / CELLS, cells=(CELLS + 2, 2))
    body = tawami.box(grid, (0, 0), (L, 2 * L / CELLS), per_axis=2)
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
    """Largest error of displacement, velocity and acceleration in the mode, over the largest value of
    each in the run; infinite if the energy grows.
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
    """Error of the elongation under the weight after 40 damped steps.

    With gamma = 1 each step reduces the distance from rest to at most a third.
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
    """Every form with steps of every size, and the static limit."""
    ratios = [1e-8, 1e-4, 1.0, 1e3] if short else [10.0**k for k in range(-12, 7)]
    for form in ("u", "u_epsv_finite") if short else FORMS:
        for ratio in ratios:
            yield attempted(
                SUBJECT, f"{form}, dt = {ratio:g} T", BOUND,
                partial(oscillation, form, ratio),
            )  # fmt: skip
        for ratio in (10.0, 1e3) if short else (1.0, 10.0, 100.0, 1e3):
            # the sum over the particles replaces an integral, with an error of second order
            yield attempted(
                SUBJECT, f"{form}, dt = {ratio:g} T, damped to rest", 2e-3,
                partial(rest, form, ratio),
            )  # fmt: skip
