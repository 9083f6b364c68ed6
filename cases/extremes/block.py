"""The block that several subjects share: 0.5 m x 0.5 m of 4 x 4 cells, in the middle of a grid."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

import tawami

Array = npt.NDArray[np.float64]

SIDE, H = 0.5, 0.125  # of the block, of its cells [m]
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
    """The block on lines of the grid.

    Args:
        form: Weak form.
        law: Linear elastic with nu = 0.4 where none is given.
        cells: Of the grid; the block is about its middle.
        shift: Of the block from the lines of the grid [cells].
        per_axis: Particles per cell and axis.
        grid: One that was made so before; another one by default.
        options: For `tawami.Scene`.
    """
    origin = tuple(-H * (n // 2) for n in cells)
    grid = grid or tawami.Grid(MPI.COMM_WORLD, origin=origin, h=H, cells=cells)
    half = SIDE / 2
    body = tawami.box(grid, (-half, -half), (half, half), per_axis=per_axis)
    body = tawami.Body(body.x + H * np.array(shift), body.volume)
    law = tawami.linear_elastic(E=E, nu=0.4) if law is None else law
    if form == "u_epsv_finite":
        options.setdefault("alpha", 0.01)
    options.setdefault("density", RHO)
    return tawami.Scene(grid, body, law, form=form, **options)


def spinning(scene: tawami.Scene, omega: float, **options: Any) -> tawami.Dynamics:
    """Set in rotation about the origin [rad/s], its affine velocities too."""
    spin = omega * np.array([[0.0, -1.0], [1.0, 0.0]])
    motion = tawami.Dynamics(scene, velocity=np.array(scene.particles.x) @ spin.T, **options)
    motion.velocity_gradient[:] = spin
    return motion


def state(motion: tawami.Dynamics) -> dict[str, Array]:
    """Copies of all arrays of the particles, by name."""
    particles = motion.scene.particles
    arrays = {name: getattr(particles, name) for name in ("x", "volume", "stress", "displacement")}
    if motion.scene.form.kinematics.has_eps_v:
        arrays["eps_v"] = particles.eps_v
    arrays |= {name: particles.history(name) for name in particles.history_names}
    arrays |= {
        name: particles.carried(name)
        for name in ("velocity", "acceleration", "velocity_gradient", "acceleration_gradient")
    }
    return {name: np.array(array) for name, array in arrays.items()}


def changed(before: dict[str, Array], motion: tawami.Dynamics) -> list[str]:
    """Names of the arrays that are not what they were, to the bit."""
    now = state(motion)
    return [name for name in now if not np.array_equal(now[name], before[name], equal_nan=True)]
