"""The vibrating beam and Timoshenko's theory of it. This module does not depend on a method.

    held  |=====================|   D = 1 m    plane strain, E = 1 MPa, nu = 0.3 and 0.49
                 L = 8 m                       rho = 1000 kg/m3, y upward from the axis of the beam

The beam starts straight, with the velocity of its first bending mode.

Theory: Timoshenko 1921, with shear deformation and rotary inertia. In plane strain Ebar = E/(1 - nu^2)
and nubar = nu/(1 - nu) replace E and nu. For displacements u_y = w, u_x = -y phi at the frequency omega

    w' = phi + Q / (kappa G D)        phi' = M / (Ebar I)
    M' = -Q - rho I omega^2 phi       Q' = -rho D omega^2 w

with w = phi = 0 at the root and M = Q = 0 at the tip. The shear coefficient is that of a narrow
rectangle in plane stress, 5 (1 + nu)/(6 + 5 nu) (Hutchinson 2001, J. Appl. Mech. 68, 87), which is
5/(6 - nu) in plane strain. The theory neglects that the held root cannot contract along y.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.linalg import expm
from scipy.optimize import brentq

Array = npt.NDArray[np.float64]

L, D = 8.0, 1.0  # length and depth [m]
E, RHO = 1.0e6, 1000.0  # [Pa], [kg/m3]
NUS = (0.3, 0.49)
AMPLITUDE = 0.1  # of the tip [m]: L/80, strains up to 0.3 %. Frequencies change with its square


def lame(nu: float) -> tuple[float, float]:
    """Bulk and shear modulus [Pa]."""
    return E / (3 * (1 - 2 * nu)), E / (2 * (1 + nu))


def first_bending(nu: float) -> float:
    """Angular frequency of the first bending mode [rad/s]."""
    slender = 3.516 * np.sqrt(_stiffness(nu) / (RHO * D)) / L**2

    def held_and_free(omega: float) -> float:
        return float(np.linalg.det(expm(_system(nu, omega) * L)[2:, 2:]))

    return float(brentq(held_and_free, 0.8 * slender, slender, xtol=1e-12 * slender))


def mode(nu: float, x: Array) -> tuple[Array, Array, Array, Array]:
    """w, phi, w' and phi' of the first mode at x [m], scaled to w = 1 at the tip."""
    system = _system(nu, first_bending(nu))
    to_tip = expm(system * L)
    root = np.array([0.0, 0.0, -to_tip[2, 3], to_tip[2, 2]])  # w, phi, M, Q; M = 0 at the tip
    distinct, where = np.unique(x, return_inverse=True)
    states = np.array([expm(system * s) @ root for s in distinct]) / (to_tip @ root)[0]
    w, phi = states[where, :2].T
    dw, dphi = (states @ system.T)[where, :2].T
    return w, phi, dw, dphi


def _stiffness(nu: float) -> float:
    """Bending stiffness Ebar I per metre depth [N m]."""
    return E / (1 - nu**2) * D**3 / 12


def _system(nu: float, omega: float) -> Array:
    """Matrix of the four equations above, for the state (w, phi, M, Q)."""
    shear = 5 / (6 - nu) * lame(nu)[1] * D
    system = np.zeros((4, 4))
    system[0, 1], system[0, 3] = 1.0, 1 / shear
    system[1, 2] = 1 / _stiffness(nu)
    system[2, 1], system[2, 3] = -RHO * D**3 / 12 * omega**2, -1.0
    system[3, 0] = -RHO * D * omega**2
    return system
