"""Two materials, one up to 10^13 times as stiff, in series and in parallel, with closed forms.

A bar in plane strain, with Gauss points, is stretched along x between smooth sides. In series (left half
soft) both halves carry the same stress. In parallel (lower half soft, the same Lame constant lambda, so
that the stress across the bar is the same too) both have the same strain.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from mpi4py import MPI

import tawami
from cases.extremes.attempt import Attempt, attempted
from cases.extremes.forms import BASES, FORMS

SUBJECT = "stiffness contrast"
NX, NY, H = 8, 4, 0.25
LENGTH = NX * H
MU, LAMBDA, STRETCH = 1e6, 1.5e6, 1e-3  # [Pa], [Pa], mean strain [-]; nu = 0.3 for the soft one
CONTRASTS = (1e1, 1e3, 1e5, 1e7, 1e9, 1e11, 1e13)


def scene_of(
    form: str, basis: Any, arrangement: str, contrast: float
) -> tuple[tawami.Scene, float]:
    """The bar, stretched, and the force of the closed form [N per metre depth]."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0.0, 0.0), h=H, cells=(NX, NY))
    body = tawami.box(grid, grid.origin, grid.upper, per_axis=3, gauss=True)
    series = arrangement == "series"
    laws = [
        tawami.linear_elastic(K=LAMBDA * (c if series else 1.0) + 2 / 3 * MU * c, mu=MU * c)
        for c in (1.0, contrast)
    ]
    axis = 0 if series else 1
    stiff = (body.x[:, axis] > grid.upper[axis] / 2).astype(int)
    scene = tawami.Scene(grid, body, laws, material_of=stiff, basis=basis, **FORMS[form])
    scene.fix("left", "x")
    scene.fix("bottom", "y")
    scene.fix("top", "y")
    scene.fix("right", "x", STRETCH * LENGTH)
    soft = LAMBDA + 2 * MU
    if series:
        return scene, NY * H * STRETCH * 2 * soft / (1 + 1 / contrast)
    return scene, NY * H / 2 * STRETCH * (soft + LAMBDA + 2 * MU * contrast)


def force_error(form: str, basis: str, arrangement: str, contrast: float) -> tuple[float, str]:
    """Relative error of the force."""
    scene, exact = scene_of(form, basis, arrangement, contrast)
    solution = scene.solve()
    return abs(solution.reaction("right")[0] / exact - 1), f"condition {solution.condition:.0e}"


def representable(form: str, basis: str, arrangement: str) -> bool:
    """Whether the fields can represent the closed form.

    In series the strain jumps at the interface and p does not. In parallel p jumps and the strains
    do not; B-bar with quadratic functions does not balance this (`tests/field/test_patch.py`).
    """
    if arrangement == "parallel":
        return form != "u_p" and (form != "u_bbar" or basis == "bilinear")
    return basis != "quadratic_spline" and form in ("u", "u_bbar", "u_p")


def attempts(short: bool) -> Iterator[Attempt]:
    """Each form and basis at each contrast.

    Fields that can represent the closed form must reproduce it to 1e-5: Newton's tolerance of 1e-6,
    times 10 for a force that is a sum over the end. The others smear the jump over a cell: the
    error of their force may be the share of a cell in the soft half (or in the height).
    """
    for arrangement in ("series", "parallel"):
        for basis in BASES[:2] if short else BASES:
            for form in list(FORMS)[::2] if short else FORMS:
                exact = representable(form, basis, arrangement)
                smeared = 2 / NX if arrangement == "series" else 2 / NY
                for contrast in CONTRASTS[::3] if short else CONTRASTS:
                    yield attempted(
                        SUBJECT,
                        f"{arrangement}, {form}, {basis}: {contrast:g}",
                        1e-5 if exact else smeared,
                        lambda f=form, b=basis, a=arrangement, c=contrast: force_error(f, b, a, c),
                    )
