"""A pile of aluminium rods collapses under its own weight, on a rough floor and along a smooth wall.

    |________        0.2 m x 0.1 m, plane strain, E = 0.84 MPa, nu = 0.3, rho = 2040 kg/m3
    |        |       Drucker-Prager without cohesion, phi = 21.9 degrees
    |________|__     floor held, left wall smooth, right wall removed at t = 0

The pile starts with the stress of a pile at rest between walls: sigma_y is the overburden, sigma_x half
of it. The mixed u-eps_v form at finite strain is compared with B-bar and displacement only.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from time import perf_counter
from typing import Any

import numpy as np
import numpy.typing as npt
from mpi4py import MPI
from scipy.spatial import cKDTree

import tawami
from cases.common.program import progress

Array = npt.NDArray[np.float64]

LENGTH, HEIGHT = 0.2, 0.1  # of the pile [m]
RHO, G = 2040.0, 9.81  # [kg/m3], [m/s2]
E, NU, PHI = 0.84e6, 0.3, 21.9  # [Pa], [-], [degrees]
FORMS = ("u_epsv_finite", "u_bbar_finite", "u_finite")


@dataclass
class Run:
    """A run and its records.

    Attributes:
        form: Weak form.
        volume: Volumes of the particles at the start [m2].
        iterations: Newton iterations of each accepted step.
        dt: Size of each accepted step [s].
        ends: Time at the end of each accepted step [s].
        time: Recorded times [s].
        runout, energies, roughness: Values at the recorded times [m, J/m, -].
        x, mean_stress: Positions [m] and mean stress [Pa] of the particles at the recorded times.
        seconds: Wall time.
    """

    form: str
    volume: Array
    iterations: list[int] = field(default_factory=list)
    dt: list[float] = field(default_factory=list)
    ends: list[float] = field(default_factory=list)
    time: list[float] = field(default_factory=list)
    runout: list[float] = field(default_factory=list)
    energies: list[Any] = field(default_factory=list)
    roughness: list[float] = field(default_factory=list)
    x: list[Array] = field(default_factory=list)
    mean_stress: list[Array] = field(default_factory=list)
    seconds: float = 0.0


def build(
    form: str,
    *,
    h: float = 0.01,
    nu: float = NU,
    psi: float = 0.0,
    per_axis: int = 2,
    size: tuple[float, float] = (LENGTH, HEIGHT),
    cells: tuple[int, int] | None = None,
    transfer: str = "affine_flip",
    **options: Any,
) -> tawami.Dynamics:
    """The pile without its wall.

    Args:
        form: Weak form.
        h: Cell size [m].
        nu: Poisson's ratio.
        psi: Angle of dilation [degrees].
        per_axis: Particles per cell and axis.
        size: Length and height of the pile [m].
        cells: Numbers of cells of the grid; room for a run-out of twice the height by default.
        transfer: Transfer between particles and grid.
        options: Options of `Scene`; alpha is 0.01 by default in the mixed form.
    """
    length, height = size
    cells = cells or (round((2 * length + 4 * height) / h), round(1.4 * height / h))
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0.0, 0.0), h=h, cells=cells)
    body = tawami.box(grid, (0.0, 0.0), size, per_axis=per_axis)
    rods = tawami.drucker_prager(tawami.linear_elastic(E=E, nu=nu), phi=PHI, psi=psi)
    parameters = {"alpha": 0.01} if form == "u_epsv_finite" else {}
    scene = tawami.Scene(grid, body, rods, form=form, density=RHO, **(parameters | options))
    scene.gravity((0.0, -G))
    scene.fix("left", "x")
    scene.fix("bottom", "x")
    scene.fix("bottom", "y")
    vertical = -RHO * G * (height - scene.particles.x[:, 1])
    horizontal = 0.5 * vertical
    scene.particles.stress[:, :3] = np.column_stack(
        [horizontal, vertical, 0.5 * (horizontal + vertical)]
    )
    return tawami.Dynamics(scene, transfer=transfer)


def solve(
    form: str,
    *,
    h: float = 0.01,
    dt: float = 1e-3,
    end: float = 0.8,
    every: int = 20,
    **options: Any,
) -> Run:
    """Run the collapse to the time `end` [s] with steps of `dt` [s]; record every `every` steps."""
    motion = build(form, h=h, **options)
    run, start = Run(form, np.array(motion.scene.particles.volume)), perf_counter()
    record(run, motion, h)
    with progress(total=end, desc=form, unit="s") as bar:

        def after_step(_: tawami.Solution) -> None:
            bar.update(motion.time - bar.n)
            if motion.time > len(run.time) * every * dt - 1e-9:
                record(run, motion, h)

        steps = motion.run(end, dt, each=after_step)
        if run.time[-1] < end - 1e-9:
            record(run, motion, h)
    run.iterations = [step.iterations for step in steps]
    run.dt, run.ends = [step.size for step in steps], [step.end for step in steps]
    run.seconds = perf_counter() - start
    return run


def record(run: Run, motion: tawami.Dynamics, h: float) -> None:
    """Record what the figures need."""
    x = np.array(motion.scene.particles.x)
    stress = motion.scene.particles.stress[:, :3].mean(axis=1)
    run.time.append(motion.time)
    run.runout.append(float(np.quantile(x[:, 0], 0.99)))  # without the few that fly ahead
    run.energies.append(motion.energies)
    run.roughness.append(roughness(x, stress, h))
    run.x.append(x)
    run.mean_stress.append(stress)


def roughness(x: Array, values: Array, h: float) -> float:
    """rms residual of a local linear fit over 24 neighbours within 3 h, over the rms of the values."""
    distance, index = cKDTree(x).query(x, k=25, distance_upper_bound=3 * h)
    residuals = []
    for p in range(len(x)):
        near = index[p][np.isfinite(distance[p])]
        if len(near) < 8:
            continue
        basis = np.column_stack([np.ones(len(near)), x[near] - x[p]])
        fit = np.linalg.lstsq(basis, values[near], rcond=None)[0]
        residuals.append(values[p] - fit[0])
    return float(np.sqrt(np.mean(np.square(residuals))) / np.sqrt(np.mean(values**2)))
