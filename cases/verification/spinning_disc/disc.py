"""A free disc of nearly incompressible rubber spins ten times: conservation and roundness.

                  R = 1 m, plane strain, E = 1 MPa, nu = 0.49, rho = 1000 kg/m3
      omega ( o ) rho omega^2 R^2 / E = 0.05

The disc starts with the velocity of a rigid rotation and without stress. It therefore pulsates about
the steady state of a rotating disc in plane strain (Timoshenko and Goodier, rotating discs), with
nubar = nu/(1 - nu):

    sigma_r + sigma_t = rho omega^2 / 4 { (3 + nubar) R^2 - 2 (1 + nubar) r^2 }
    mean stress       = (1 + nu)/3 (sigma_r + sigma_t)

Volumetric strains reach 0.3 %, half of that without the pulsation.

The forces have no moment: sum m x x a = 0 after every step. The trapezoidal rule then conserves
sum m (x + dt v/2) x (v + dt a/2), that is sum m (x x v + dt^2/4 v x a), but not sum m x x v. At the
start a = 0, in the steady state a = -omega^2 x. So sum m x x v decreases by the share
(omega dt)^2/4, and by up to twice that while the disc pulsates. With 150 steps per turn this is below
1e-3. The remaining change is due to the transfer.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from time import perf_counter
from typing import Any

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

import tawami
from cases.common.program import progress
from tawami.picture import style

Array = npt.NDArray[np.float64]

R, RHO = 1.0, 1000.0  # radius [m], density [kg/m3]
E, NU = 1.0e6, 0.49  # [Pa], [-]
OMEGA = float(np.sqrt(0.05 * E / RHO) / R)  # [rad/s]
TURN = 2 * np.pi / OMEGA  # [s]
TENSION = RHO * OMEGA**2 * R**2  # unit of the stresses [Pa]


@dataclass(frozen=True)
class Kind:
    """Form and transfer of a run, with its name and colour in the figures."""

    form: str
    transfer: str
    name: str
    colour: str


KINDS = (
    Kind("u_epsv_finite", "affine_flip", "mixed, affine FLIP", style.VERMILION),
    Kind("u_epsv_finite", "tpic", "mixed, TPIC", style.BLUE),
    Kind("u_finite", "affine_flip", "displacement only, affine FLIP", style.GRAY),
    Kind("u_epsv_finite", "flip", "mixed, plain FLIP", style.ORANGE),
)


@dataclass
class Run:
    """A run and its records, at the start and after every step.

    Attributes:
        kind: Form and transfer.
        radii: Distances of the particles from the centre at the start [m].
        steps: Steps per turn.
        turns: Time in turns [-].
        angular: Angular momentum, over that of the start.
        conserved: Quantity that the trapezoidal rule conserves, over the angular momentum of the start.
        energy: Kinetic plus elastic energy, over that of the start.
        linear: Linear momentum, over the sum of its magnitudes.
        roundness: (r_max - r_min)/R of the outer ring, about the centre of mass.
        x: Positions of the particles at the start and after each turn [m].
        steady: Mean stress of the particles, averaged over each turn [Pa].
        seconds: Wall time.
    """

    kind: Kind
    radii: Array
    steps: int
    turns: list[float] = field(default_factory=list)
    angular: list[float] = field(default_factory=list)
    conserved: list[float] = field(default_factory=list)
    energy: list[float] = field(default_factory=list)
    linear: list[float] = field(default_factory=list)
    roundness: list[float] = field(default_factory=list)
    x: list[Array] = field(default_factory=list)
    steady: list[Array] = field(default_factory=list)
    seconds: float = 0.0

    @property
    def drift(self) -> float:
        """Largest change of the angular momentum, as a share."""
        return float(np.abs(np.array(self.angular) - 1).max())

    @property
    def drift_of_transfer(self) -> float:
        """Largest change of the quantity that the trapezoidal rule conserves, as a share."""
        return float(np.abs(np.array(self.conserved) - 1).max())

    @property
    def stress_error(self) -> list[float]:
        """rms error of the mean stress of each turn, over its rms."""
        exact = mean_stress(self.radii)
        return [float(np.sqrt(np.mean((s - exact) ** 2) / np.mean(exact**2))) for s in self.steady]


def mean_stress(r: Array, nu: float = NU) -> Array:
    """Mean stress [Pa] of the steady state at distances r [m] from the centre."""
    nubar = nu / (1 - nu)
    both = RHO * OMEGA**2 / 4 * ((3 + nubar) * R**2 - 2 * (1 + nubar) * r**2)
    return np.asarray((1 + nu) / 3 * both)


def rings(number: int) -> tawami.Body:
    """A disc as a number of rings with 3, 9, 15, ... particles of equal volume.

    Ring k lies between (k - 1) dr and k dr and has 3 (2 k - 1) particles, which are nearly square. They
    are at the rms radius of the ring, so that volume and polar moment are those of the disc.
    """
    places = []
    for k in range(1, number + 1):
        count = 3 * (2 * k - 1)
        r = R / number * np.sqrt(((k - 1) ** 2 + k**2) / 2)
        angle = 2 * np.pi / count * (np.arange(count) + 0.5 * (k % 2))
        places.append(r * np.column_stack([np.cos(angle), np.sin(angle)]))
    x = np.concatenate(places)
    return tawami.Body(x, np.full(len(x), np.pi * R**2 / len(x)))


def build(
    kind: Kind,
    *,
    n: int = 6,
    per_axis: int = 3,
    nu: float = NU,
    alpha: float = 0.01,
    **options: Any,
) -> tawami.Dynamics:
    """The disc in motion.

    Args:
        kind: Form and transfer.
        n: Cells over the radius.
        per_axis: Rings per cell.
        nu: Poisson's ratio.
        alpha: Stabilisation, for the mixed form.
        options: Other options of `Scene`.
    """
    h = R / n
    # the grid is not symmetric about the centre of the disc
    origin = (-(n + 2 + 0.013) * h, -(n + 2 + 0.007) * h)
    grid = tawami.Grid(MPI.COMM_WORLD, origin=origin, h=h, cells=(2 * n + 5, 2 * n + 5))
    body = rings(n * per_axis)
    material = tawami.linear_elastic(E=E, nu=nu)
    if kind.form == "u_epsv_finite":
        options["alpha"] = alpha
    scene = tawami.Scene(grid, body, material, form=kind.form, density=RHO, **options)
    spin = OMEGA * np.array([[0.0, -1.0], [1.0, 0.0]])
    motion = tawami.Dynamics(scene, velocity=body.x @ spin.T, transfer=kind.transfer)
    motion.velocity_gradient[:] = spin
    return motion


def solve(
    kind: Kind = KINDS[0],
    *,
    turns: int = 10,
    steps: int = 150,
    nu: float = NU,
    **options: Any,
) -> Run:
    """Run a number of turns."""
    motion = build(kind, nu=nu, **options)
    scene, begin, dt = motion.scene, perf_counter(), TURN / steps
    radii = np.linalg.norm(np.array(scene.particles.x), axis=1)
    run = Run(kind, radii, steps)
    record(run, motion, dt)
    run.x.append(np.array(scene.particles.x))
    with progress(total=turns, desc=kind.name, unit="turn") as bar:
        for _ in range(turns):
            total = np.zeros(len(radii))
            for _ in range(steps):
                motion.step(dt)
                record(run, motion, dt)
                total += scene.particles.stress[:, :3].mean(axis=1)
            run.steady.append(total / steps)
            run.x.append(np.array(scene.particles.x))
            bar.update()
    run.seconds = perf_counter() - begin
    return run


def record(run: Run, motion: tawami.Dynamics, dt: float) -> None:
    """Record the state after a step."""
    scene, v, a = motion.scene, motion.velocity, motion.acceleration
    x = np.array(scene.particles.x)
    spin = OMEGA * motion.mass @ run.radii**2
    moment = motion.mass @ (v[:, 0] * a[:, 1] - v[:, 1] * a[:, 0])
    speed = motion.mass @ np.linalg.norm(v, axis=1)
    outer = np.isclose(run.radii, run.radii.max())
    r = np.linalg.norm(x[outer] - motion.mass @ x / motion.mass.sum(), axis=1)
    run.turns.append(motion.time / TURN)
    run.angular.append(motion.angular_momentum() / spin)
    run.conserved.append((motion.angular_momentum() + dt**2 / 4 * moment) / spin)
    run.energy.append((motion.kinetic_energy + motion.elastic_energy) / (0.5 * OMEGA * spin))
    run.linear.append(float(np.abs(motion.linear_momentum).max() / speed))
    run.roundness.append(float((r.max() - r.min()) / R))
