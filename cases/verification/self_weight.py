"""A column that collapses under its own weight: finite strain across many cells of the grid.

Held at the sides, Hencky elastic with nu = 0, so that every layer is in uniaxial strain and carries
what stands on it: `E ln(l) / l = -rho0 g (H - Z)` gives the stretch l of the layer that was at Z.
The weight comes in equal increments, each a step with the grid reset.

python -m cases.verification.self_weight
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI
from scipy.integrate import quad
from scipy.special import lambertw

import tawami

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
    """Integral of the stretch [m]."""
    return float(quad(stretch, 0.0, H)[0])


@dataclass(frozen=True)
class Result:
    """What came of a run: height of the column [m], error of it, rms error of the vertical stress over
    the base stress, Newton iterations of each step.
    """

    height: float
    height_error: float
    stress_error: float
    iterations: tuple[int, ...]


def build(form: str, h: float = 1.0, **options: object) -> tawami.Scene:
    """The column at a cell size [m]; with two cells abreast, instead of one, B-bar bulges sideways."""
    cells = round(H / h)
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0.0, 0.0), h=h, cells=(1, cells))
    body = tawami.box(grid, (0.0, 0.0), (h, H))
    material = tawami.linear_elastic(E=E, nu=0.0)
    scene = tawami.Scene(grid, body, material, form=form, density=WEIGHT / G, **options)
    scene.fix("left", "x")
    scene.fix("right", "x")
    scene.fix("bottom", "y")
    return scene


def solve(form: str, *, h: float = 1.0, increments: int = 20, **options: object) -> Result:
    """The column under its weight, in increments."""
    scene = build(form, h, **options)
    iterations = []
    for k in range(1, increments + 1):
        scene.gravity((0.0, -G * k / increments))
        iterations.append(scene.solve().iterations)
    height, stress = errors(scene)
    return Result((1 + height) * final_height(), height, stress, tuple(iterations))


def errors(scene: tawami.Scene) -> tuple[float, float]:
    """Errors of the height and, rms over the base stress, of the vertical stress."""
    end = np.array(scene.particles.x[:, 1])
    if not scene.form.strain.finite:
        end += scene.particles.displacement[:, 1]
        start = np.array(scene.particles.x[:, 1])
    else:
        start = end - scene.particles.displacement[:, 1]
    # the top is half a (deformed) particle above the highest one
    top = start.max()
    height = end.max() + (H - top) * stretch(0.5 * (H + top))
    # tau_yy = E ln l; Cauchy's stress is that over the stretch
    stretches = np.array([stretch(z) for z in start])
    stress = np.array(scene.particles.stress[:, 1])
    if scene.form.strain.finite:
        stress /= stretches
    exact = E * np.log(stretches) / stretches
    rms = float(np.sqrt(np.mean((stress - exact) ** 2)) / (WEIGHT * H))
    return height / final_height() - 1, rms


def main() -> None:
    """Print height and stress beside the closed form."""
    scene = build("u_epsv_finite")
    scene.gravity((0.0, -G))
    print(scene.header())
    print(f"closed form: {final_height():.5f} m")
    for form in FORMS:
        r = solve(form)
        print(
            f"{form:14} height {r.height:.5f} m ({100 * r.height_error:+.3f} %), stress rms "
            f"{100 * r.stress_error:.2f} % of the base stress, Newton iterations {r.iterations}"
        )


if __name__ == "__main__":
    tawami.run(main, "self_weight")
