"""The cantilever by the material point method: 2n x n cells, 2 x 2 particles in each.

python -m cases.verification.cantilever.mpm
"""

from __future__ import annotations

from time import perf_counter

import numpy as np
from mpi4py import MPI

import tawami
from cases.common.program import Program
from cases.common.table import as_text
from cases.verification.cantilever.beam import (
    COLUMNS,
    NU,
    D,
    E,
    L,
    P,
    Row,
    mean_stress,
    root_displacement_x,
    shear,
)


def build(
    method: str,
    support: str,
    n: int,
    *,
    material: tawami.Material | tawami.NumpyLaw | None = None,
    nu: float = NU,
    per_axis: int = 2,
    gauss: bool = False,
    **parameters: object,
) -> tawami.Scene:
    """The beam as a scene.

    Args:
        method: Form: 'u', 'u_bbar', 'u_epsv', 'u_p', or any other that `Scene` accepts.
        support: 'paper', 'exact' or 'clamped'.
        n: Cells over the height.
        material: Material; that of the paper by default.
        nu: Its Poisson's ratio, which the support 'exact' needs.
        per_axis: Particles per cell and axis.
        gauss: Particles at Gauss points instead of evenly spaced.
        parameters: Options of `Scene`: alpha, stabilisation, basis, ...
    """
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0.0, -D / 2), h=D / n, cells=(2 * n, n))
    body = tawami.box(grid, (0.0, -D / 2), (L, D / 2), per_axis=per_axis, gauss=gauss)
    material = material or tawami.linear_elastic(E=E, nu=nu)
    scene = tawami.Scene(grid, body, material, form=method, **parameters)

    if support == "clamped":
        scene.fix("left", "x")
        scene.fix("left", "y")
        scene.traction("right", (0.0, -P / D))
    elif support == "paper":
        scene.fix("left", "x")
        scene.hold((0.0, 0.0), "y")
        scene.traction("right", (0.0, -P / D))
    elif support == "exact":
        scene.fix("left", "x", lambda x, y: root_displacement_x(y, nu))
        scene.hold((0.0, 0.0), "y")
        scene.traction("left", (0.0, lambda x, y: shear(y)))
        scene.traction("right", (0.0, lambda x, y: -shear(y)))
    else:
        raise tawami.InputError(f"support '{support}': expected 'paper', 'exact' or 'clamped'")
    return scene


def solve(
    method: str, support: str, n: int, alpha: float | None = None, **options: object
) -> tuple[Row, tawami.Solution]:
    """Solve the beam.

    Args:
        method, support, n: As in `build`.
        alpha: Stabilisation, for the forms that have it.
        options: As in `build`.
    """
    start = perf_counter()
    if alpha is not None:
        options["alpha"] = alpha
    scene = build(method, support, n, **options)
    solution = scene.solve()
    error = mean_stress_error(solution) if support == "exact" else None
    row = Row(
        method=method,
        support=support,
        n=n,
        alpha=alpha,
        particles_per_cell=scene.num_particles // (2 * n * n),
        deflection_m=-solution.displacement((L, 0.0))[1],
        mean_stress_l2=error,
        newton_iterations=solution.iterations,
        unknowns=solution.unknowns,
        wall_s=perf_counter() - start,
    )
    return row, solution


def mean_stress_error(solution: tawami.Solution, nu: float = NU) -> float:
    """Relative L2 error of the mean stress at the particles."""
    exact = mean_stress(solution.x[:, 0], solution.x[:, 1], nu)
    weight = np.sqrt(solution.volume)
    error = weight * (solution.mean_stress - exact)
    return float(np.linalg.norm(error) / np.linalg.norm(weight * exact))


PROGRAM = Program("cases.verification.cantilever.mpm", __doc__, files=False)


def main() -> None:
    """Print the deflections with the support of the paper."""
    PROGRAM.start()
    cells = (2, 4, 8, 16)
    print(as_text([solve("u_epsv", "paper", n, alpha=0.1)[0] for n in cells], COLUMNS))
    print(as_text([solve("u_bbar", "paper", n)[0] for n in cells], COLUMNS))


if __name__ == "__main__":
    PROGRAM.run(main)
