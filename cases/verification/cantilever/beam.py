"""The beam, its supports and its closed forms. This module does not depend on a method.

    y
    |            L = 2 m                      plane strain, one static step
    +--------------------------------+        E = 3.0e3 kPa, nu = 0.4999
 root   D = 1 m                      | tip    P = 1 kN per metre depth, downward
    +--------------------------------+--- x

Three supports, because with the first the deflection has no limit (see `point_support_growth`):

paper     u_x = 0 on the root, u_y = 0 at its centre, uniform shear on the tip
exact     displacement and tractions of the closed form; the limit is eq. (3)
clamped   u = 0 on the root, uniform shear on the tip

Source: the paper, section 3; Timoshenko and Goodier, Theory of Elasticity, art. 21.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import log, pi
from typing import Any

SUPPORTS = ("paper", "exact", "clamped")

P = 1.0e3  # tip load [N per metre depth]
L = 2.0  # length [m]
D = 1.0  # height [m]
E = 3.0e6  # Young's modulus [Pa]
NU = 0.4999  # Poisson's ratio
I = D**3 / 12  # noqa: E741 - second moment of area [m4 per metre depth], named as in the paper

K, MU = E / (3 * (1 - 2 * NU)), E / (2 * (1 + NU))
LAMBDA = K - 2 * MU / 3


def deflection(nu: float) -> float:
    """Tip deflection, eq. (3) [m]. The paper prints E where E_bar is meant."""
    e_bar, nu_bar = E / (1 - nu**2), nu / (1 - nu)
    return P / (6 * e_bar * I) * ((4 + 5 * nu_bar) * D**2 * L / 4 + 2 * L**3)


#: Deflection for the Poisson's ratio of the paper [m].
V_THEORY = deflection(NU)

#: Limit of the deflection of the clamped beam [m], found by refinement; there is no closed form.
V_CLAMPED = 0.009684

COLUMNS = (
    "method", "support", "n", "alpha", "particles_per_cell", "deflection_m", "error_percent",
    "mean_stress_l2", "newton_iterations", "unknowns", "wall_s",
)  # fmt: skip


@dataclass(frozen=True)
class Row:
    """One line of the table. None stands for an empty cell."""

    method: str
    support: str
    n: int
    alpha: float | None
    particles_per_cell: int | None
    deflection_m: float
    mean_stress_l2: float | None
    newton_iterations: int
    unknowns: int
    wall_s: float

    @property
    def error_percent(self) -> float:
        """Error of the deflection, eq. (4) [%]."""
        return 100 * (self.deflection_m - V_THEORY) / V_THEORY


def root_displacement_x(y: Any, nu: float = NU) -> Any:
    """Displacement u_x [m] of the closed form on the root."""
    e_bar, nu_bar = E / (1 - nu**2), nu / (1 - nu)
    return (2 + nu_bar) * P * y * (y**2 - D**2 / 4) / (6 * e_bar * I)


def shear(y: Any) -> Any:
    """Parabolic shear traction [Pa] with the resultant P, upward on the root and downward on the tip."""
    return 1.5 * P / D * (1 - 4 * y**2 / D**2)


def mean_stress(x: Any, y: Any, nu: float = NU) -> Any:
    """Mean stress [Pa] of the closed form: (1 + nu)/3 sigma_xx, sigma_xx = P (L - x) y / I."""
    return (1 + nu) / 3 * P * (L - x) * y / I


def point_support_growth() -> float:
    """Growth of the deflection [m] for each halving of h with the support `paper`.

    The centre point carries the whole reaction P. Mirrored at the root, where u_x = 0, this is a
    force 2 P in a full plane: u_y ~ 2 P (3 - 4 nu) / (8 pi mu (1 - nu)) ln(1/r) (Kelvin, plane
    strain). The grid cuts this off at r ~ h.
    """
    return 2 * P * (3 - 4 * NU) / (8 * pi * MU * (1 - NU)) * log(2)
