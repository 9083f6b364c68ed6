"""Friction angles from 0 to 90 degrees without cohesion, Drucker-Prager and Mohr-Coulomb.

References: between smooth plates that shorten a block and widen it by the same amount, the ratio of
the stresses becomes (1 + sin phi)/(1 - sin phi) with both laws; dust that flies apart has no stress
and conserves its kinetic energy, except for the work against the resistance to opening in mixed forms;
a collapsing pile has no spurious energy and no stress beyond the yield surface, which is evaluated
here independently of the package.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

import tawami
from cases.extremes import block
from cases.extremes.attempt import Attempt, attempted

SUBJECT = "friction angle"
Array = npt.NDArray[np.float64]
LAWS = {"Drucker-Prager": tawami.drucker_prager, "Mohr-Coulomb": tawami.mohr_coulomb}
P = 1.0e-3 * block.E  # pressure [Pa]
G = 10.0
#: Bound of the yield function: the return is exact up to round-off. In mixed forms particles that fly
#: apart have a mean stress beyond the apex, small compared with the stress under the pile.
YIELD, OPENING = 1e-9, 0.02
#: Bound of the spurious energy: grid and particles compute the work of the weight differently.
SPURIOUS = 0.02
#: Resistance to opening beyond the apex in mixed forms, as a share of mu.
SOFT = 0.1


def law(name: str, phi: float, **options: Any) -> tawami.Material:
    """A law without cohesion; angles below 1.6 degrees are intended."""
    elastic = tawami.linear_elastic(E=block.E, nu=0.3)
    return LAWS[name](elastic, phi=phi, tiny_angle=phi < 1.6, **options)


def biaxial(name: str, phi: float) -> float:
    """Relative error of the ratio of the stresses between the plates at the end.

    The block is one cell with bilinear functions, all of them held by the plates. Without dilatancy a
    homogeneous strain is unstable at large angles (Rudnicki and Rice 1975).
    """
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=1.0, cells=(1, 1))
    body = tawami.box(grid, (0, 0), (1, 1), per_axis=2)
    scene = tawami.Scene(grid, body, law(name, phi), form="u_epsv", basis="bilinear")
    scene.particles.stress[:, :3] = -P
    ratio = (1 + np.sin(np.radians(phi))) / (1 - np.sin(np.radians(phi)))
    # in plane strain the out-of-plane stress needs many times the elastic strain to reach its limit
    strain = 40 * P * ratio / block.E
    scene.fix("left", "x")
    scene.fix("bottom", "y")
    scene.fix("right", "x", strain)
    scene.fix("top", "y", -strain)
    tawami.ramp(scene, 0.005, stop="raise")
    found = np.array(scene.particles.stress)
    return float(np.abs(found[:, 1] / found[:, 0] / ratio - 1).max())


def beyond(name: str, phi: float, stress: Array) -> float:
    """Largest value of the yield function, over the largest stress."""
    s = np.radians(phi)
    mean = stress[:, :3].mean(axis=1)
    if name == "Mohr-Coulomb":
        middle = (stress[:, 0] + stress[:, 1]) / 2
        radius = np.hypot((stress[:, 0] - stress[:, 1]) / 2, stress[:, 3])
        principal = np.sort(np.column_stack([middle + radius, middle - radius, stress[:, 2]]))
        value = principal[:, 2] - principal[:, 0] + (principal[:, 2] + principal[:, 0]) * np.sin(s)
    else:
        deviator = stress - np.outer(mean, [1.0, 1.0, 1.0, 0.0])
        j2 = (deviator[:, :3] ** 2).sum(axis=1) / 2 + deviator[:, 3] ** 2
        value = np.sqrt(j2) + np.sin(s) * mean
    return float((value / max(np.abs(stress).max(), 1e-300)).max())


def dust(name: str, phi: float, form: str) -> float:
    """The larger of the stress over E of a block that flies apart, and of its loss of kinetic energy.

    Dust has no stress. In a mixed form its mean stress is SOFT mu times the volumetric strain of the
    step (`rust/law/mod.rs`), which is subtracted, and the work against it: a block that is not slowed
    down would do sum_n SOFT mu V (ln J_n - ln J_(n-1))^2.
    """
    rate, dt, steps = np.array([[3.0, 1.0], [0.0, 2.0]]), 0.01, 20
    scene = block.scene(form, law=law(name, phi))
    motion = tawami.Dynamics(scene, velocity=np.array(scene.particles.x) @ rate.T)
    motion.velocity_gradient[:] = rate
    start = motion.kinetic_energy
    for _ in range(steps):
        motion.step(dt)
    stress = np.abs(scene.particles.stress).max()
    loss = 1 - motion.kinetic_energy / start
    if form == "u_epsv_finite":
        gradients = np.eye(2) + dt * np.arange(steps + 1)[:, None, None] * rate
        opened = np.diff(np.log(np.linalg.det(gradients)))
        modulus = SOFT * block.E / 2.6  # nu = 0.3
        stress = max(stress - modulus * opened.max(), 0.0)
        loss = max(loss - modulus * scene.particles.volume.sum() * (opened**2).sum() / start, 0.0)
    return float(max(stress / block.E, abs(loss)))


def pile(name: str, phi: float, form: str) -> float:
    """The larger of yield function and spurious energy of a pile, over its bound; the limit is 1."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=block.H, cells=(40, 8))
    body = tawami.box(grid, (0, 0), (8 * block.H, 4 * block.H), per_axis=2)
    options: dict[str, Any] = {"alpha": 0.01} if form == "u_epsv_finite" else {}
    scene = tawami.Scene(grid, body, law(name, phi), form=form, density=block.RHO, **options)
    scene.gravity((0.0, -G))
    scene.fix("left", "x")
    scene.fix("bottom", "x")
    scene.fix("bottom", "y")
    weight = block.RHO * G * (4 * block.H - np.array(body.x)[:, 1])
    scene.particles.stress[:, :3] = -weight[:, None]
    motion, states = tawami.Dynamics(scene), [0.0]
    start, y = motion.elastic_energy, np.array(scene.particles.x)[:, 1]
    motion.run(0.4, 0.004, each=lambda solution: states.append(beyond(name, phi, solution.stress)))
    work = G * float(motion.mass @ (y - np.array(scene.particles.x)[:, 1]))
    e = motion.energies
    spurious = (e.kinetic + e.elastic + e.dissipated) / (start + work) - 1
    allowed = OPENING if form == "u_epsv_finite" else YIELD
    return float(max(max(states) / allowed, spurious / SPURIOUS))


def attempts(short: bool) -> Iterator[Attempt]:
    """Both laws, with angles up to their limits."""
    angles = (0.0, 5.0, 50.0) if short else (0.0, 0.1, 5.0, 20.0, 35.0, 50.0, 70.0, 89.0, 90.0)
    for name in LAWS:
        for phi in angles:
            # round-off times the ratio of the stresses, which is 1e4 at 89 degrees
            yield attempted(
                SUBJECT, f"{name}, {phi:g} degrees, biaxial", 1e-8,
                partial(biaxial, name, phi),
            )  # fmt: skip
        for form in block.FINITE[:1] if short else block.FINITE:
            for phi in (30.0,) if short else (5.0, 30.0, 50.0):
                # no stress, up to Newton's tolerance of the trial states
                yield attempted(
                    SUBJECT, f"{name}, {phi:g} degrees, {form}, dust", 1e-6,
                    partial(dust, name, phi, form),
                )  # fmt: skip
                yield attempted(
                    SUBJECT, f"{name}, {phi:g} degrees, {form}, pile", 1.0,
                    partial(pile, name, phi, form),
                )  # fmt: skip
