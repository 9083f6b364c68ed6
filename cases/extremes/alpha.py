"""The stabilisation from alpha = 0 to 1000 on the cantilever, compared with an estimate from theory.

Let p and p_a be the mean stress without and with the Laplacian's term, and e the difference of the two
solutions. The difference of their weak forms, tested with e, is

    2 mu |dev eps(e_u)|^2 + |e_p|^2 / K + alpha h^2/mu |grad e_p|^2 = -alpha h^2/mu (grad p, grad e_p)

so that |2 mu dev eps(e_u)| <= h sqrt(alpha/2) |grad p| for any alpha, however large. The same holds for
the projection with |p - p_c| in place of h |grad p|, where p_c is the mean of p over a cell. For a
bilinear p its square is h^2/12 |grad p|^2, up to terms of higher order in h.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator
from math import sqrt

import numpy as np

from cases.extremes.attempt import Attempt, attempted
from cases.verification.cantilever import beam, mpm

SUBJECT = "alpha"
ALPHAS = (0.0, 1e-4, 1e-3, 0.01, 0.1, 0.3, 1.0, 10.0, 100.0, 1000.0)
STABILISATIONS = ("laplacian", "projection", "residual_based")
N = 8  # cells over the height


@functools.cache
def deviator_error(form: str, alpha: float, stabilisation: str, n: int = N) -> tuple[float, float]:
    """L2 error of the deviatoric stress over the norm of the mean stress, relative error of the
    deflection.
    """
    options = {"stabilisation": stabilisation} if form == "u_epsv" else {}
    solution = mpm.build(form, "exact", n, alpha=alpha, **options).solve()
    x, y = solution.x.T
    nu = beam.NU
    along = beam.P * (beam.L - x) * y / beam.I
    exact = np.zeros((len(x), 4))  # sigma_xx = along, sigma_zz = nu sigma_xx, sigma_xy = -shear
    exact[:, 0], exact[:, 2], exact[:, 3] = along, nu * along, -beam.shear(y)
    mean = exact[:, :3].mean(axis=1)
    error = solution.stress - exact
    error[:, :3] -= (solution.mean_stress - mean)[:, None]
    weights = np.array([1.0, 1.0, 1.0, 2.0])
    size = sqrt(np.sum(solution.volume[:, None] * weights * error**2))
    deflection = -solution.displacement((beam.L, 0.0))[1] / beam.deflection(nu) - 1
    return size / sqrt(np.sum(solution.volume * mean**2)), deflection


def measured(form: str, alpha: float, stabilisation: str) -> tuple[float, str]:
    """The error of the deviator, and the error of the deflection as a remark."""
    error, deflection = deviator_error(form, alpha, stabilisation)
    return error, f"deflection {100 * deflection:.2g} % off"


def gradient_over_size() -> float:
    """|grad p| / |p| [1/m] of the closed form, p = c (L - x) y."""
    L, D = beam.L, beam.D
    return sqrt((L * D**3 / 12 + L**3 / 3 * D) / (L**3 / 3 * D**3 / 12))


def bound_of(form: str, alpha: float, stabilisation: str) -> float:
    """Error without the term, plus the estimate above.

    The residual-based term is consistent and adds nothing to the estimate: its bound is twice the error
    without the term.
    """
    without = deviator_error(form, 0.0, stabilisation)[0]
    if stabilisation == "residual_based":
        return 2 * without
    part = 1 / 12 if stabilisation == "projection" else 1.0
    # a result with a larger error than the estimate at alpha = 1 is useless, even if theory allows it
    alpha = min(alpha, 1.0)
    # 5 % because the gradient is that of the closed form instead of the discrete p
    return without + 1.05 * sqrt(part * alpha / 2) / N * gradient_over_size()


def attempts(short: bool) -> Iterator[Attempt]:
    """Each stabilisation and alpha."""
    chosen = ("laplacian", "residual_based") if short else STABILISATIONS
    forms = [("u_epsv", name) for name in chosen] + [("u_p", "laplacian")] * (not short)
    for form, name in forms:
        for alpha in ALPHAS[1::4] if short else ALPHAS:
            setting = f"{form}, {name}: alpha = {alpha:g}"
            bound = bound_of(form, alpha, name)
            yield attempted(
                SUBJECT, setting, bound, lambda f=form, a=alpha, s=name: measured(f, a, s)
            )
    for value in (-0.1, float("nan"), float("inf")):
        yield attempted(
            SUBJECT, f"alpha = {value}", None, lambda a=value: measured("u_epsv", a, "laplacian")
        )
