"""A column that shrinks under its own weight: finite strain across many cells of the grid.

    |   |   H = 50 m     E = 10 kPa, nu = 0, Hencky elastic; rho0 g = 800 N/m3
    |   |                held at the sides and at the bottom: uniaxial strain
    |___|

Each layer carries the weight above it. E ln(l) / l = -rho0 g (H - Z) gives the stretch l of the layer
that was at Z. The weight is applied in equal increments; each is a step, after which the grid is reset.

python -m cases.verification.self_weight
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from mpi4py import MPI
from scipy.integrate import quad
from scipy.special import lambertw

import tawami
from cases.common.program import Program
from cases.common.table import as_text

H = 50.0  # height [m]
E = 1.0e4  # Young's modulus [Pa]
WEIGHT = 800.0  # rho0 g [N/m3]
G = 10.0  # [m/s2]
FORMS = ("u_finite", "u_epsv_finite", "u_bbar_finite")


def stretch(z: float) -> float:
    """Stretch of the layer that was at height z [m].

    The nominal stress is E ln(l)/l = -s with s = rho0 g (H - z): l = -W(-(-s/E)) / (s/E) with
    Lambert's W, since (1/l) ln(1/l) = s/E.
    """
    s = WEIGHT * (H - z) / E
    return float(np.exp(-lambertw(s).real)) if s > 0 else 1.0


def final_height() -> float:
    """Height of the column under its weight [m], the integral of the stretch."""
    return float(quad(stretch, 0.0, H)[0])


@dataclass(frozen=True)
class Result:
    """Result of a run.

    Attributes:
        form: Weak form.
        height: Height of the column [m].
        height_error: Relative error of the height.
        stress_error: rms error of the vertical stress over the stress at the base.
        iterations: Newton iterations of each step.
    """

    form: str
    height: float
    height_error: float
    stress_error: float
    iterations: tuple[int, ...]

    @property
    def most_iterations(self) -> int:
        """Largest number of Newton iterations of a step."""
        return max(self.iterations)


COLUMNS = ("form", "height", "height_error", "stress_error", "most_iterations")


def build(form: str, h: float = 1.0, **options: object) -> tawami.Scene:
    """The column, one cell wide, with cells of side h [m]. With two cells B-bar bulges sideways."""
    cells = round(H / h)
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0.0, 0.0), h=h, cells=(1, cells))
    body = tawami.box(grid, (0.0, 0.0), (h, H), per_axis=2)
    material = tawami.linear_elastic(E=E, nu=0.0)
    scene = tawami.Scene(grid, body, material, form=form, density=WEIGHT / G, **options)
    scene.fix("left", "x")
    scene.fix("right", "x")
    scene.fix("bottom", "y")
    return scene


def solve(form: str, *, h: float = 1.0, increments: int = 20, **options: object) -> Result:
    """Apply the weight in increments."""
    scene = build(form, h, **options)
    iterations = []
    weight = scene.gravity((0.0, 0.0))
    for k in range(1, increments + 1):
        weight.change((0.0, -G * k / increments))
        iterations.append(scene.solve().iterations)
    height, stress = errors(scene, form)
    return Result(form, (1 + height) * final_height(), height, stress, tuple(iterations))


def errors(scene: tawami.Scene, form: str) -> tuple[float, float]:
    """Relative error of the height, and rms error of the vertical stress over that at the base."""
    particles, finite = scene.particles, form.endswith("_finite")
    now, displacement = np.array(particles.x[:, 1]), particles.displacement[:, 1]
    start, end = (now - displacement, now) if finite else (now, now + displacement)
    # the top is half a (deformed) particle above the highest one
    top = start.max()
    height = end.max() + (H - top) * stretch(0.5 * (H + top))
    # tau_yy = E ln l, and Cauchy's stress is tau_yy / l
    stretches = np.array([stretch(z) for z in start])
    stress = particles.stress[:, 1] / (stretches if finite else 1.0)
    exact = E * np.log(stretches) / stretches
    rms = float(np.sqrt(np.mean((stress - exact) ** 2)) / (WEIGHT * H))
    return height / final_height() - 1, rms


PROGRAM = Program("cases.verification.self_weight", __doc__, files=False)


def main(arguments: Sequence[str] | None = None) -> None:
    """Print height and stress with each form, compared with the closed form."""
    PROGRAM.start(arguments)
    scene = build("u_epsv_finite")
    scene.gravity((0.0, -G))
    print(scene.header())
    print(f"closed form: {final_height():.5f} m")
    print(as_text([solve(form) for form in FORMS], COLUMNS))


if __name__ == "__main__":
    PROGRAM.run(main)
