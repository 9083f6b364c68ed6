"""Poisson's ratio up to 0.5 on the cantilever, compared with its closed form."""

from __future__ import annotations

from collections.abc import Iterator

from mpi4py import MPI

import tawami
from cases.extremes.attempt import Attempt, attempted
from cases.verification.cantilever import beam, mpm

SUBJECT = "Poisson's ratio"
METHODS = {
    "u": {"method": "u"},
    "u_bbar": {"method": "u_bbar"},
    "u_epsv": {"method": "u_epsv", "alpha": 0.1},
    "u_epsv, alpha = 0": {"method": "u_epsv", "alpha": 0.0},
    "u_p": {"method": "u_p", "alpha": 0.1},
}
#: Values of 1 - 2 nu; 0 is nu = 0.5 exactly.
COMPRESSIBILITY = (1e-2, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12, 1e-14, 0.0)
N = 8  # cells over the height


def errors(name: str, one_minus_2nu: float, n: int = N) -> tuple[float, float]:
    """Relative errors of the mean stress (L2) and of the deflection."""
    nu = (1 - one_minus_2nu) / 2
    law = tawami.linear_elastic(E=beam.E, one_minus_2nu=one_minus_2nu)
    options = dict(METHODS[name])
    scene = mpm.build(options.pop("method"), "exact", n, material=law, nu=nu, **options)
    solution = scene.solve()
    deflection = -solution.displacement((beam.L, 0.0))[1]
    return mpm.mean_stress_error(solution, nu), abs(deflection / beam.deflection(nu) - 1)


def measured(name: str, one_minus_2nu: float) -> tuple[float, str]:
    """The larger error, and the error of the deflection as a remark."""
    of_stress, of_deflection = errors(name, one_minus_2nu)
    return max(of_stress, of_deflection), f"deflection {100 * of_deflection:.2g} % off"


def enclosed() -> float:
    """A body with nu = 0.5 held on all sides: a constant pressure is undetermined."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0.0, 0.0), h=0.25, cells=(4, 4))
    body = tawami.box(grid, grid.origin, grid.upper, per_axis=3, gauss=True)
    law = tawami.linear_elastic(E=1.0, nu=0.5)
    scene = tawami.Scene(grid, body, law, form="u_p", density=1.0)
    for edge in ("left", "right", "bottom", "top"):
        scene.fix(edge, "x")
        scene.fix(edge, "y")
    scene.gravity((0.0, -1.0))
    scene.solve()
    return 0.0


def attempts(short: bool) -> Iterator[Attempt]:
    """Each form at each Poisson's ratio.

    The bound is twice the error at nu = 0.3, where no form locks. A method is free of locking if its
    error does not depend on nu (Babuska and Suri 1992).
    """
    for name in METHODS:
        bound = 2 * max(errors(name, 0.4))
        for c in COMPRESSIBILITY[1::3] if short else COMPRESSIBILITY:
            setting = f"{name}: 1 - 2 nu = {c:g}" if c else f"{name}: nu = 0.5"
            yield attempted(SUBJECT, setting, bound, lambda n=name, c=c: measured(n, c))
    yield attempted(SUBJECT, "u_p: nu = 0.5, held all around", None, enclosed)
