"""Large bending of a slender cantilever by a dead load at its tip: static, at finite strain.

    held  |=====================|  P      length L = 2 m, depth D = 0.1 m, plane strain
                                |         E = 1 MPa, Hencky elastic; P L^2/(Ebar I) = 1 and 10
                                v

The reference is the elastica, a line that bends and does not stretch. With the distance s from the
root, the angle theta below the horizontal, I = D^3/12 and Ebar = E/(1 - nu^2) in plane strain,

    Ebar I theta'' = -P cos theta,    theta(0) = 0,    theta'(L) = 0.

Integrated once this is theta'^2 = 2 P/(Ebar I) (sin theta_L - sin theta). The angle theta_L of the tip
follows from elliptic integrals (Bisshopp and Drucker 1945, Quart. Appl. Math. 3, 272).

The beam differs from an elastica by, as shares of the deflection of the tip:

    shear           (D/L)^2 / (2 (1 - nu) kappa), kappa = 5/(6 - nu)          0.2 %
    extension       up to P/(Ebar D L) = (D/L)^2/12 times 1 or 10               0.02 %, 0.2 %
    fibres          strains up to 11 % at the root for P L^2/(Ebar I) = 10: an effect of second order
                    on the deflection and of first order on the mean stress
    particles       N of them over the depth have the second moment I (1 - 1/N^2): 1.6 % for N = 8
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from scipy.special import ellipeinc, ellipkinc

Array = npt.NDArray[np.float64]

D, SLENDER, E = 0.1, 20, 1.0e6  # depth [m], length over depth [-], Young's modulus [Pa]
LOADS = (1.0, 10.0)  # P L^2/(Ebar I) [-]


def tip_angle(load: float) -> float:
    """Angle [rad] of the tip under P L^2/(Ebar I) = load.

    sqrt(load) = F(pi/2, m) - F(phi, m), m = (1 + sin theta_L)/2, sin(phi)^2 = 1/(2 m).
    """

    def missing(angle: float) -> float:
        m, phi = _modulus(angle)
        return float(ellipkinc(np.pi / 2, m) - ellipkinc(phi, m) - np.sqrt(load))

    return float(brentq(missing, 1e-9, np.pi / 2 - 1e-9, xtol=1e-14))


def tip(load: float) -> Array:
    """Displacement (x, y) of the tip, divided by the length.

    y = -1 + 2 (E(pi/2, m) - E(phi, m)) / sqrt(load), x = sqrt(2 sin(theta_L) / load) - 1.
    """
    angle = tip_angle(load)
    m, phi = _modulus(angle)
    arc = ellipeinc(np.pi / 2, m) - ellipeinc(phi, m)
    return np.array([np.sqrt(2 * np.sin(angle) / load) - 1, 2 * arc / np.sqrt(load) - 1])


def _modulus(angle: float) -> tuple[float, float]:
    """Parameter m of the elliptic integrals and their lower limit phi."""
    m = (1 + np.sin(angle)) / 2
    return m, np.arcsin(1 / np.sqrt(2 * m))


def curve(load: float, s: Array) -> Array:
    """The elastica of length 1 at distances s from the root: x, y, theta, curvature; 4 x points."""

    def change(_s: float, state: Array) -> Array:
        theta, curvature = state[2:]
        return np.array([np.cos(theta), -np.sin(theta), curvature, -load * np.cos(theta)])

    root = [0.0, 0.0, 0.0, np.sqrt(2 * load * np.sin(tip_angle(load)))]
    return np.asarray(solve_ivp(change, (0.0, 1.0), root, t_eval=s, rtol=1e-10, atol=1e-12).y)


def pressed_tip(load: float) -> Array:
    """Displacement (x, y) of the tip under a pressure that follows the side, divided by the length.

    The part of the line beyond s carries a pressure p per length, whose moment at s is p/2 times the
    square of the distance rho of the tip: Ebar I theta' = p rho^2/2. In a frame that turns with the
    tip this is integrated from the tip, where rho = 0, to the root.

    Args:
        load: p L^3/(Ebar I).
    """

    def change(_s: float, state: Array) -> Array:
        x, y, angle = state  # of a point, seen from the tip, and of the line there
        return np.array([-np.cos(angle), -np.sin(angle), -load * (x**2 + y**2) / 2])

    x, y, angle = solve_ivp(change, (0.0, 1.0), np.zeros(3), rtol=1e-10, atol=1e-12).y[:, -1]
    # back to the frame of the root, which points along x
    c, s = np.cos(angle), np.sin(angle)
    return np.array([-(c * x + s * y) - 1, c * y - s * x])


def mean_stress(load: float, nu: float, L: float, x: Array) -> Array:
    """Mean stress (1 + nu)/3 Ebar theta' y [Pa] of the elastica.

    Args:
        load: P L^2/(Ebar I).
        nu: Poisson's ratio.
        L: Length to the load [m].
        x: Positions in the straight beam [m], points x 2.
    """
    s, where = np.unique(x[:, 0] / L, return_inverse=True)
    curvature = curve(load, s)[3][where] / L
    return np.asarray((1 + nu) / 3 * E / (1 - nu**2) * curvature * x[:, 1])
