"""Thermal expansion with conduction: `u_epsv` and a temperature theta.

eps_v is the elastic volumetric strain, so that the expansion 3 a theta needs no stress in any law:

    div u = eps_v + eps_p + 3 a theta,    rho c theta' = div(k grad theta).

Time is integrated with backward Euler. theta acts on u, and u does not act on theta: the heat of changes
of volume and of plastic work is left out. Only changes of theta expand; it is 0 at the start unless
`initial` gives a value. A flux of theta is the heat that enters, in W/m2.

alpha_theta stabilises theta as alpha_w does p_w in `u_epsv_pw`: it acts on the increment and vanishes
with h. Without it theta overshoots near heated faces in steps of D dt < h^2/6, D = k/(rho c).
"""

from ufl import dot, inner

from tawami.form import scalar, vector

fields = {
    "u": vector("w"),
    "eps_v": scalar("q", role="volumetric_strain"),
    "theta": scalar("r", unit="K"),
}
data = {
    "expansion": "linear thermal expansion a [1/K]",
    "conductivity": "thermal conductivity k [W/(m K)]",
    "capacity": "heat capacity c [J/(kg K)]",
}
parameters = {
    "alpha": {"default": 0.01, "minimum": 0.0, "usual": 1.0, "unit": "-"},
    "alpha_theta": {"default": 1 / 6, "minimum": 0.0, "usual": 1.0, "unit": "-"},
}


def residual(
    u, eps_v, theta, w, q, r, sigma, eps_p, K, mu, rho, h, dt, old, grad, div, sum_p, expansion,
    conductivity, capacity, alpha, alpha_theta,
):  # fmt: skip
    """R_u = sum_p V_p sigma_p : grad w
    R_q = sum_p V_p K_p { q (div u - eps_v - eps_p - 3 a theta)
                          - alpha h^2 (K_p/mu_p) grad q . grad eps_v }
    R_r = sum_p V_p { rho c (r theta + alpha_theta h^2 grad r . grad theta)/dt
                      + k grad r . grad(old theta + theta) }.
    """
    R_u = sum_p(inner(sigma, grad(w)))
    R_q = sum_p(K * q * (div(u) - eps_v - eps_p - 3 * expansion * theta))
    R_q -= sum_p(K**2 / mu * alpha * h**2 * dot(grad(q), grad(eps_v)))
    stored = r * theta + alpha_theta * h**2 * dot(grad(r), grad(theta))
    R_r = sum_p(rho * capacity * stored / dt)
    R_r += sum_p(conductivity * dot(grad(r), grad(old.theta + theta)))
    return R_u + R_q + R_r
