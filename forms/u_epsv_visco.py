"""Kelvin-Voigt creep: `u_epsv` with a viscous stress beside that of the law.

The total stress is sigma + 2 eta dev(eps(u))/dt, u the increment of the step (backward Euler). It creeps
with the time eta/mu towards the elastic state. The stress of the particles is sigma alone.
"""

from ufl import dot, inner

from tawami.form import scalar, vector

fields = {"u": vector("w"), "eps_v": scalar("q", role="volumetric_strain")}
data = {"eta": "viscosity [Pa s]"}
parameters = {"alpha": {"default": 0.01, "minimum": 0.0, "usual": 1.0, "unit": "-"}}


def residual(
    u, eps_v, w, q, sigma, eps_p, K, mu, h, dt, grad, div, eps, I, sum_p, eta, alpha
):  # fmt: skip
    """R_u = sum_p V_p (sigma_p + 2 eta dev(eps(u))/dt) : grad w
    R_q = that of u_epsv.
    """
    rate = (eps(u) - div(u) / 3 * I) / dt
    R_u = sum_p(inner(sigma + 2 * eta * rate, grad(w)))
    R_q = sum_p(K * q * (div(u) - eps_v - eps_p))
    return R_u + R_q - sum_p(K**2 / mu * alpha * h**2 * dot(grad(q), grad(eps_v)))
