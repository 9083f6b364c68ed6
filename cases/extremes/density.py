"""Densities from 1e-9 to 1e9 kg/m3, of one material or as the contrast of two.

References are free fall, and the first axial mode of a bar of two densities with the same E:

    tan(k1 a) tan(k2 (L - a)) = k1/k2,    k = omega sqrt(rho/E),  a the length of the held part

At a high contrast this is a mass on a spring, or a heavy bar with a tip without mass.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt
from mpi4py import MPI
from scipy.optimize import brentq

import tawami
from cases.extremes import block
from cases.extremes.attempt import Attempt, attempted

SUBJECT = "density"
Array = npt.NDArray[np.float64]
L, A, E = 1.0, 0.5, 1.0e6  # length of the bar and of its held part [m]; [Pa]
CELLS, STEPS = 32, 50  # along the bar, in a quarter of the period
G = 10.0
#: Of the period. A function at the border of the two parts has mass of both: the mass of half a cell is
#: misplaced, which is h/(2 L) = 1.6 % of the period; less than half of that counts.
BOUND = 0.02
#: Newton's tolerance of the forces. For small rho the round-off of the stiffness, eps E u,
#: approaches m g.
TOLERANCE = 1e-6


def fall(form: str, densities: tuple[float, float], dt: float = 0.01) -> float:
    """Error of the velocity after 20 steps of free fall, over g t; two materials in layers."""
    made = tawami.linear_elastic(E=block.E, nu=0.4)
    x = block.scene(form).particles.x
    upper = (np.array(x)[:, 1] > 0).astype(int)
    scene = block.scene(form, law=[made, made], material_of=upper, density=list(densities))
    scene.gravity((0.0, -G))
    motion = tawami.Dynamics(scene)
    for _ in range(20):
        motion.step(dt)
    expected = np.array([0.0, -G * 20 * dt])
    return float(np.abs(motion.velocity - expected).max() / (G * 20 * dt))


def frequency(held: float, free: float) -> float:
    """Angular frequency of the first axial mode of the bar of two densities [rad/s]."""
    scale = np.pi / 2 * np.sqrt(E / max(held, free)) / L
    a, b = (np.sqrt(rho / E) for rho in (held, free))

    def balance(omega: float) -> float:
        """Zero at the frequency of a mode: cos cos - (b/a) sin sin."""
        first, second = omega * a * A, omega * b * (L - A)
        return float(np.cos(first) * np.cos(second) - b / a * np.sin(first) * np.sin(second))

    top = scale
    while balance(top) > 0:
        top *= 1.01
    return float(brentq(balance, 1e-3 * top, top, xtol=1e-14 * top))


def mode(omega: float, held: float, free: float, x: Array) -> Array:
    """Displacement of the mode at x [m], scaled to 1 where the parts meet."""
    k1, k2 = (omega * np.sqrt(rho / E) for rho in (held, free))
    inner = np.sin(k1 * x) / np.sin(k1 * A)
    outer = np.cos(k2 * (L - x)) / np.cos(k2 * (L - A))
    return np.where(x < A, inner, outer)


def vibration(form: str, held: float, free: float) -> float:
    """Error of the period, from the velocity in the mode after a quarter of a period."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=L / CELLS, cells=(CELLS + 2, 2))
    body = tawami.box(grid, (0, 0), (L, 2 * L / CELLS), per_axis=2)
    x = body.x[:, 0]
    options: dict[str, Any] = {"alpha": 0.0} if "epsv" in form else {}
    made = tawami.linear_elastic(E=E, nu=0.0)
    scene = tawami.Scene(
        grid, body, [made, made], material_of=(x > A).astype(int), form=form,
        density=[held, free], **options,
    )  # fmt: skip
    for edge, component in (("left", "x"), ("bottom", "y"), ("top", "y")):
        scene.fix(edge, component)  # type: ignore[arg-type]
    omega = frequency(held, free)
    shape = mode(omega, held, free, x)
    size = 1e-4 * L * omega / np.abs(shape).max()
    motion = tawami.Dynamics(scene, velocity=size * np.column_stack([shape, 0 * x]))
    quarter = np.pi / (2 * omega)
    motion.run(quarter, quarter / STEPS)
    weight = motion.mass * shape
    return float(abs(weight @ motion.velocity[:, 0] / (weight @ shape) / size) * 2 / np.pi)


def attempts(short: bool) -> Iterator[Attempt]:
    """Free fall and vibration, with one density and with two."""
    forms = ("u_epsv_finite",) if short else ("u_epsv_finite", "u_bbar_finite", "u")
    every = (1e-9, 1e9) if short else (1e-9, 1e-6, 1e-3, 1.0, 1e3, 1e6, 1e9)
    for form in forms:
        for rho in every:
            yield attempted(
                SUBJECT, f"{form}, free fall, {rho:g} kg/m3", TOLERANCE,
                partial(fall, form, (rho, rho)),
            )  # fmt: skip
        for low, high in (
            ((1.0, 1e9), (1e9, 1.0)) if short else ((1e-9, 1e9), (1.0, 1e9), (1e9, 1.0))
        ):
            yield attempted(
                SUBJECT, f"{form}, free fall, {low:g} below {high:g} kg/m3", TOLERANCE,
                partial(fall, form, (low, high)),
            )  # fmt: skip
        for rho in every:
            yield attempted(
                SUBJECT, f"{form}, bar of {rho:g} kg/m3", BOUND,
                partial(vibration, form, rho, rho),
            )  # fmt: skip
        for contrast in (1e9,) if short else (1e1, 1e3, 1e6, 1e9, 1e12):
            for held, free in ((1.0, contrast), (contrast, 1.0)):
                yield attempted(
                    SUBJECT, f"{form}, bar of {held:g} and {free:g} kg/m3", BOUND,
                    partial(vibration, form, held, free),
                )  # fmt: skip
