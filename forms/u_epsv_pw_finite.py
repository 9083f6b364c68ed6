"""Consolidation at finite strain: `u_epsv_finite` for the skeleton, with water in its pores.

tau is the effective Kirchhoff stress, p_w the pore pressure, J = det F the volume over that at the start
of the scene, V0. Water and grains do not change their volume, so that water leaves as J shrinks:

    J' + J div q_w = 0,    q_w = -(kappa/mu_w) J^m (grad p_w - rho_w b).

`density` is that of the saturated soil at the start, and rho_w (J - 1) the mass of water that has come.
With rho_w = 0 and the buoyant density, p_w is the excess pore pressure. `leak` [1/(Pa s)] is the water
that leaves a volume per time and pressure: drains, or a drained border if it is large at its particles.
A flux of p_w is the water that enters, in m/s. The rest is as in `u_epsv_pw` and `u_epsv_finite`.
"""

from ufl import dot, exp, inner, inv

from tawami.form import scalar, vector

fields = {
    "u": vector("w"),
    "eps_v": scalar("q", role="volumetric_strain"),
    "p_w": scalar("r", unit="Pa"),
}
strain = "finite"
data = {"kappa": "permeability [m2]"}
parameters = {
    "alpha": {"default": 0.01, "minimum": 0.0, "usual": 1.0, "unit": "-"},
    "theta": {"default": 0.01, "minimum": 0.0, "maximum": 1.0, "unit": "-"},
    "alpha_w": {"default": 1 / 6, "minimum": 0.0, "usual": 1.0, "unit": "-"},
    "mu_w": {"default": 1e-3, "minimum": 0.0, "unit": "Pa s"},
    "rho_w": {"default": 1e3, "minimum": 0.0, "unit": "kg/m3"},
    "m": {"default": 0.0, "unit": "-"},
    "leak": {"default": 0.0, "minimum": 0.0, "unit": "1/(Pa s)"},
    "k": {"default": 0.01, "minimum": 0.0, "unit": "-"},
}
options = {"ghost_penalty": ("on", "off")}


def residual(
    u, eps_v, p_w, w, q, r, P, ln_J, eps_p, K, mu, b, h, dt, old, grad, I, sum_p, sum_v, dG,
    facet_mean, jump_n, jump_nn, kappa, alpha, theta, alpha_w, mu_w, rho_w, m, leak, k, ghost_penalty,
):  # fmt: skip
    """With g = f^-T grad, gradients at the end of the step, p = old p_w + p_w, J = old J det f:

    R_u = sum_p V0_p { (tau_p - J p I) : g w - rho_w (J - 1) b . w }
    R_q = that of u_epsv_finite
    R_r = sum_p V0_p { r (J - old J)/dt + J^(1+m) kappa/mu_w g r . (g p - rho_w b) + leak J r p
                       + alpha_w h^2/(K_p + 4 mu_p/3) grad r . grad p_w / dt }.
    """
    p, J, F = old.p_w + p_w, old.J * exp(ln_J), inv(I + grad(u)).T
    g_r, g_p = dot(F, grad(r)), dot(F, grad(p))
    R_u = sum_p(inner(P, grad(w)) - J * p * inner(F, grad(w)))
    R_u -= sum_p(rho_w * (J - 1) * dot(b, w))
    R_q = sum_p(K * q * (ln_J - eps_p - (1 - theta) * eps_v)) - sum_v(K, theta * q * eps_v)
    R_q -= sum_p(K**2 / mu * alpha * h**2 * dot(grad(q), grad(eps_v)))
    weight = sum(rho_w * b[i] * g_r[i] for i in range(len(b)))
    R_r = sum_p(r * (J - old.J) / dt + leak * J * r * p)
    R_r += sum_p(J ** (1 + m) * kappa / mu_w * (dot(g_r, g_p) - weight))
    R_r += sum_p(alpha_w * h**2 / (K + 4 * mu / 3) * dot(grad(r), grad(p_w)) / dt)
    if ghost_penalty == "on":
        R_u += k * facet_mean(mu) * h**3 * inner(jump_nn(u), jump_nn(w)) * dG
        R_q -= k * facet_mean(K**2 / mu) * h**3 * jump_n(eps_v) * jump_n(q) * dG
    return R_u + R_q + R_r
