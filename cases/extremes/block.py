"""The block of several subjects: 0.5 m x 0.5 m, 4 x 4 cells, in the middle of a grid."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

import tawami
from cases.extremes.attempt import array_names

Array = npt.NDArray[np.float64]

SIDE, H = 0.5, 0.125  # sides of the block and of a cell [m]
E, RHO = 1.0e5, 1000.0  # [Pa], [kg/m3]
MASS = RHO * SIDE**2  # [kg per metre depth]
FINITE = ("u_epsv_finite", "u_bbar_finite", "u_finite")


def scene(
    form: str = "u_epsv_finite",
    *,
    law: tawami.Material | Sequence[tawami.Material] | None = None,
    cells: tuple[int, int] = (16, 16),
    shift: tuple[float, float] = (0.0, 0.0),
    per_axis: int = 2,
    grid: tawami.Grid | None = None,
    **options: Any,
) -> tawami.Scene:
    """The block as a scene.

    Args:
        form: Weak form.
        law: Material law; linear elastic with nu = 0.4 by default.
        cells: Cells of the grid. The block is in its middle.
        shift: Shift of the block from the grid lines [cells].
        per_axis: Particles per cell and axis.
        grid: A grid with these cells; a new one by default.
        options: Options of `Scene`.
    """
    origin = tuple(-H * (n // 2) for n in cells)
    grid = grid or tawami.Grid(MPI.COMM_WORLD, origin=origin, h=H, cells=cells)
    half = SIDE / 2
    body = tawami.box(grid, (-half, -half), (half, half), per_axis=per_axis)
    by = H * np.array(shift)
    corners = half * np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) + by
    border = tawami.polyline(corners, names=["bottom", "right", "top", "left"])
    body = replace(body, x=body.x + by, border=border)
    law = tawami.linear_elastic(E=E, nu=0.4) if law is None else law
    if form == "u_epsv_finite":
        options.setdefault("alpha", 0.01)
    options.setdefault("density", RHO)
    return tawami.Scene(grid, body, law, form=form, **options)


def spinning(scene: tawami.Scene, omega: float, **options: Any) -> tawami.Dynamics:
    """A motion that starts as a rotation about the origin with `omega` [rad/s]."""
    spin = omega * np.array([[0.0, -1.0], [1.0, 0.0]])
    motion = tawami.Dynamics(scene, velocity=np.array(scene.particles.x) @ spin.T, **options)
    motion.velocity_gradient[:] = spin
    return motion


def state(motion: tawami.Dynamics) -> dict[str, Array]:
    """Copies of all arrays of the particles by name."""
    particles = motion.scene.particles
    arrays = {name: getattr(particles, name) for name in array_names(motion.scene)}
    arrays |= {name: particles.history(name) for name in particles.history_names}
    arrays |= {
        name: particles.carried(name)
        for name in ("velocity", "acceleration", "velocity_gradient", "acceleration_gradient")
    }
    return {name: np.array(array) for name, array in arrays.items()}


def changed(before: dict[str, Array], motion: tawami.Dynamics) -> list[str]:
    """Names of the arrays that have changed, compared bit for bit."""
    now = state(motion)
    return [name for name in now if not np.array_equal(now[name], before[name], equal_nan=True)]
