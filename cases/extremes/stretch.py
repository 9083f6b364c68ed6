"""Stretch by 100 % and more, and compression to a tenth and less, at finite strain.

Edges of the grid do not move, and move a body by a quarter of a cell at most. So there are three cases:

coasting  A block flies apart, or together, with the velocity (A - I) X. It is so heavy that its stress
          does not slow it down: F = I + t (A - I) everywhere. The stress is the closed form of F.
hanging   A column between smooth sides is held at its foot and loaded by its weight, upward or downward.
          The weight of the part above, w (1 - Y), is tau(stretch)/stretch at Y. Hencky's law carries at
          most (K + 4/3 mu)/e, at a stretch of e. There is no equilibrium beyond this load.
pulled    A block is pulled by its side, between smooth sides, by supports on the border inside of the
          cells. Its stress is uniform. Rows of particles move apart, while the cells stay.
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

SUBJECT = "stretch"
Array = npt.NDArray[np.float64]
LAWS = {"Hencky": tawami.linear_elastic, "neo-Hookean": tawami.neo_hookean}
#: Cells over the height of the column, 1 m, and particles per cell and axis: two remain in a cell
#: where the column is stretched to twice its length.
CELLS, PER_AXIS = 16, 4
#: Bound of `coasting`: moving particles stay 1e-5 of a cell away from its sides.
COASTING = 1e-5
#: Bound of `pulled`, rms of the error of the stress. Before it is exceeded there is a warning
#: (`tawami.domain.spacing`).
PULLED = 0.11
#: Bounds of `hanging`: with two particles per cell the rms error in tension is 1.3 and 2 % at the end of
#: a body (documentation, Limits). B-bar fails the patch test by up to 22 %.
HANGING = {"u_epsv_finite": 0.05, "u_finite": 0.05, "u_bbar_finite": 0.22}


def stress(law: str, K: float, mu: float, stretches: Array) -> Array:
    """Principal Kirchhoff stresses [Pa] of three principal stretches, independently of the package."""
    if law == "Hencky":
        e = np.log(stretches)
        return np.asarray(2 * mu * (e - e.mean()) + K * e.sum())
    J = np.prod(stretches)
    b = J ** (-2 / 3) * np.square(stretches)
    return np.asarray(mu * (b - b.mean()) + K * np.log(J))


def coasting(
    form: str, law: str, nu: float, stretches: tuple[float, float], steps: int = 40
) -> float:
    """Largest relative error of the elastic strain (mean stress/K, deviator/2 mu) and the positions."""
    made = LAWS[law](E=1.0, nu=nu)
    n = 2 * int(np.ceil(2 * max(1.0, *stretches))) + 4
    # E t^2/(rho L^2) = 1e-20: the stress does not affect the motion, even through functions with little
    # mass (the mean of B-bar is tested at the centre of a cell, wherever its particles are)
    scene = block.scene(form, law=made, cells=(n, n), density=1e20 / block.SIDE**2, tolerance=1e-10)
    begin, rate = np.array(scene.particles.x), np.diag(stretches) - np.eye(2)
    motion = tawami.Dynamics(scene, velocity=begin @ rate)
    motion.velocity_gradient[:] = rate
    motion.run(1.0, 1.0 / steps)
    K, mu = made.bulk_modulus, made.shear_modulus
    expected = stress(law, K, mu, np.array([*stretches, 1.0]))
    difference = scene.particles.stress - [*expected, 0.0]
    mean = difference[:, :3].mean(axis=1, keepdims=True)
    strains = np.abs(np.log(stretches)).max()
    wrong = max(np.abs(mean).max() / K, np.abs(difference[:, :3] - mean).max() / (2 * mu)) / strains
    place = begin @ np.diag(stretches)
    return float(max(wrong, np.abs(scene.particles.x - place).max() / np.abs(place).max()))


def hanging(form: str, law: str, nu: float, most: float) -> float:
    """The larger of the rms error of the stress, over the largest stress, and the height error."""
    made = LAWS[law](E=1.0, nu=nu)

    def nominal(stretch: float) -> float:
        both = np.array([1.0, stretch, 1.0])
        return float(stress(law, made.bulk_modulus, made.shear_modulus, both)[1] / stretch)

    weight = nominal(most)  # of the whole column, upward
    y, stretch = (np.arange(1000) + 0.5) / 1000, np.empty(1000)
    for k, share in enumerate(weight * (1 - y)):
        stretch[k] = brentq(
            lambda a, share=share: nominal(a) - share, min(most, 1.0), max(most, 1.0)
        )
    height = float(stretch.mean())
    scene = column(made, form, height, weight)
    tawami.ramp(scene, 0.05, stop="raise")
    start = np.array(scene.particles.x - scene.particles.displacement)[:, 1]
    exact = np.interp(start, y, stretch) * weight * (1 - start)
    found = scene.particles.stress[:, 1]
    top = start > start.max() - 1e-9
    expected = np.interp(start[top][0], y, np.cumsum(stretch) / 1000)
    place = abs(scene.particles.x[top, 1].mean() / expected - 1)
    return float(max(np.sqrt(np.mean((found - exact) ** 2)) / np.abs(exact).max(), place))


def column(made: tawami.Material, form: str, height: float, weight: float) -> tawami.Scene:
    """A column of 1 m between smooth sides, held at its foot; weight [N] per metre of width."""
    grid = tawami.Grid(
        MPI.COMM_WORLD, origin=(0, 0), h=1 / CELLS,
        cells=(2, int(np.ceil(CELLS * max(1.0, height))) + 4),
    )  # fmt: skip
    body = tawami.box(grid, (0, 0), (2 / CELLS, 1), per_axis=PER_AXIS)
    options: dict[str, Any] = {"alpha": 0.01} if "epsv" in form else {}
    scene = tawami.Scene(grid, body, made, form=form, density=1.0, **options)
    scene.fix("left", "x")
    scene.fix("right", "x")
    scene.fix("bottom", "y")
    scene.gravity((0.0, weight))
    return scene


def pulled(
    per_axis: int, volumes: Any, most: float, off: float = 0.4, step: float = 0.1
) -> tuple[float, str]:
    """The rms error of the stress of a neo-Hookean block, and that of the reaction. Its sides begin at a
    distance from lines of the grid [cells].
    """
    h, law = 0.25, tawami.neo_hookean(E=1.0, nu=0.3)
    cells, corner = (int(np.ceil(most / h)) + 4, 8), -(1 + off) * h
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(corner, corner), h=h, cells=cells)
    body = tawami.box(grid, (0, 0), (1, 1), per_axis=per_axis)
    scene = tawami.Scene(grid, body, law, form="u_finite", ghost_penalty="on", volumes=volumes)
    scene.fix("left", "x")
    scene.fix(["bottom", "top"], "y")
    pull = scene.fix("right", "x", 0.0)
    steps = round((most - 1) / step)
    for k in range(steps):
        pull.change((k + 1) * (most - 1) / steps)
        solution = scene.solve()
    expected = stress("neo-Hookean", law.bulk_modulus, law.shear_modulus, np.array([most, 1, 1]))[0]
    error = np.sqrt(np.mean((scene.particles.stress[:, 0] / expected - 1) ** 2))
    force = solution.reaction("right")[0] * most / expected - 1
    return float(error), f"error of the reaction {100 * force:+.2g} %"


def without_equilibrium(form: str) -> float:
    """A weight of 1.1 times the largest that a Hencky column carries."""
    made = tawami.linear_elastic(E=1.0, nu=0.3)
    most = (made.bulk_modulus + 4 / 3 * made.shear_modulus) / np.e
    tawami.ramp(column(made, form, 3.0, 1.1 * most), 0.1, stop="raise")
    return np.inf


def attempts(short: bool) -> Iterator[Attempt]:
    """Each finite form and law, compressible and nearly incompressible; then blocks that are pulled."""
    for off in (0.4,) if short else (0.4, 0.0):
        for per_axis in (2,) if short else (2, 3, 4):
            for volumes in ("own", "fitted"):
                for most in (1.4,) if short else (1.2, 1.4, 1.6, 1.8, 2.0, 2.5, 3.0, 4.0):
                    yield attempted(
                        SUBJECT,
                        f"{per_axis} x {per_axis}, volumes {volumes}, to {most:g}, sides {off:g} h off "
                        "lines, pulled", PULLED, partial(pulled, per_axis, volumes, most, off),
                    )  # fmt: skip
    forms = block.FINITE[:1] if short else block.FINITE
    shapes = {"2 x 1": (2.0, 1.0), "0.1 x 1": (0.1, 1.0)}
    if not short:
        shapes |= {"2 x 2": (2.0, 2.0), "2 x 0.5": (2.0, 0.5), "0.3 x 0.3": (0.3, 0.3),
                   "10 x 0.1": (10.0, 0.1), "10 x 1": (10.0, 1.0), "0.01 x 1": (0.01, 1.0)}  # fmt: skip
    for form in forms:
        for law in LAWS:
            for nu in (0.3, 0.4999):
                for name, stretches in shapes.items():
                    yield attempted(
                        SUBJECT, f"{form}, {law}, nu = {nu:g}, {name}, coasting", COASTING,
                        partial(coasting, form, law, nu, stretches),
                    )  # fmt: skip
                for stretch in (2.0,) if short else (2.0, 0.5, 0.1):
                    yield attempted(
                        SUBJECT, f"{form}, {law}, nu = {nu:g}, to {stretch:g}, hanging", HANGING[form],
                        partial(hanging, form, law, nu, stretch),
                    )  # fmt: skip
        yield attempted(
            SUBJECT, f"{form}, Hencky, 1.1 times its greatest load", None,
            partial(without_equilibrium, form),
        )  # fmt: skip
