"""Elastic energy of the particles of a scene."""

from __future__ import annotations

import tawami


def elastic(scene: tawami.Scene, K: float, mu: float) -> float:
    """Hencky's energy, sum_p V0_p { s_p : s_p / (4 mu) + tau_m,p^2 / (2 K) } [J per metre depth].

    Args:
        scene: One material, elastic, at finite strain: its stress tau = s + tau_m I is Kirchhoff's.
        K: Bulk modulus [Pa].
        mu: Shear modulus [Pa].
    """
    stress = scene.particles.stress
    mean = stress[:, :3].mean(axis=1)
    deviator = ((stress[:, :3] - mean[:, None]) ** 2).sum(axis=1) + 2 * stress[:, 3] ** 2
    return float(scene.particles.volume @ (deviator / (4 * mu) + mean**2 / (2 * K)))
