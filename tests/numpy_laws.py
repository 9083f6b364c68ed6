"""Material laws in NumPy that several test files use."""

from __future__ import annotations

import numpy as np

import tawami

ONE = np.array([1.0, 1.0, 1.0, 0.0])
#: The deviator of a strain, which contains gamma_xy.
I_DEV = np.diag([1.0, 1.0, 1.0, 0.5]) - np.outer(ONE, ONE) / 3


def hooke(K, mu):
    """Stress of a strain: sigma = strain @ hooke(K, mu)."""
    return K * np.outer(ONE, ONE) + 2 * mu * I_DEV


def von_mises(K, mu, yield_stress, hardening=0.0, *, tangent=True):
    """Radial return with linear hardening (Simo and Hughes 1998, box 3.2), in their symbols."""

    def respond(strain, stress, history):
        alpha = history["plastic_strain"]
        trial = stress + strain @ hooke(K, mu)
        p = trial[:, :3].mean(axis=1)[:, None]
        s = trial - p * ONE
        norm = np.sqrt((s**2 * [1, 1, 1, 2]).sum(axis=1))
        f = norm - np.sqrt(2 / 3) * (yield_stress + hardening * alpha)
        gamma = np.maximum(f, 0.0) / (2 * mu) / (1 + hardening / (3 * mu))
        n = s / np.maximum(norm, 1e-300)[:, None]
        new = p * ONE + s - 2 * mu * gamma[:, None] * n
        after = {"plastic_strain": alpha + np.sqrt(2 / 3) * gamma}
        if not tangent:
            return new, after
        theta = 1 - 2 * mu * gamma / np.maximum(norm, 1e-300)
        theta_bar = np.where(f > 0, 1 / (1 + hardening / (3 * mu)) - (1 - theta), 0.0)
        C = K * np.outer(ONE, ONE) + 2 * mu * (
            theta[:, None, None] * I_DEV - theta_bar[:, None, None] * n[:, :, None] * n[:, None, :]
        )
        return new, C, after

    return tawami.NumpyLaw(respond, K, mu, history=("plastic_strain",))


def drucker_prager(K, mu, phi, psi, c):
    """The cone of rust/law/drucker_prager.rs below its apex, without a tangent; angles in degrees."""
    sin_phi, cos_phi, tan_psi = (
        np.sin(np.radians(phi)),
        np.cos(np.radians(phi)),
        np.tan(np.radians(psi)),
    )
    Ab = 3 * tan_psi / np.sqrt(9 + 12 * tan_psi**2)
    d = np.sqrt(1 - Ab**2 / 3) + Ab * sin_phi / 3
    A, B = sin_phi / d, cos_phi / d

    def respond(strain, stress, history):
        trial = stress + strain @ hooke(K, mu)
        p = trial[:, :3].mean(axis=1)
        s = trial - p[:, None] * ONE
        root = np.sqrt((s**2 * [1, 1, 1, 2]).sum(axis=1) / 2)
        F = root + A * p - c * B
        gamma = np.maximum(F, 0.0) / (mu + K * A * Ab)
        share = 1 - mu * gamma / np.maximum(root, 1e-300)
        p = p - K * Ab * gamma
        return p[:, None] * ONE + share[:, None] * s, {
            "dilatancy": history["dilatancy"] + Ab * gamma
        }

    return tawami.NumpyLaw(respond, K, mu, history=("dilatancy",))


def stiffening(K, mu):
    """sigma = (1 + 50 eps:eps) C eps: nonlinear, without history."""
    C = hooke(K, mu)

    def respond(strain, stress):
        linear = strain @ C
        factor = 1 + 50 * np.sum(strain**2, axis=1)
        tangent = factor[:, None, None] * C + 100 * linear[:, :, None] * strain[:, None, :]
        return stress + factor[:, None] * linear, tangent

    return tawami.NumpyLaw(respond, K, mu)
