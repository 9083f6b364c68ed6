"""Mixed u-eps_v form at finite strain, updated Lagrangian: tau_m = old + K eps_v, eps_v elastic.

Strains are logarithmic: ln J_f = eps_v + eps_p, eps_p the plastic volumetric strain of the law.
ln J_f is evaluated at the particles, as is all that is nonlinear in the unknowns. V0, the volume at the
start of the scene, in both equations keeps the elastic tangent symmetric. theta lumps a share of the
mass of eps_v: a single particle in a cell makes the consistent mass singular. Constants are unchanged.
`ghost_penalty` as in `u_epsv`.
"""

from ufl import dot, inner

from tawami.form import scalar, vector

fields = {"u": vector("w"), "eps_v": scalar("q", role="volumetric_strain")}
strain = "finite"
parameters = {
    "alpha": {"default": 0.01, "minimum": 0.0, "usual": 1.0, "unit": "-"},
    "theta": {"default": 0.01, "minimum": 0.0, "maximum": 1.0, "unit": "-"},
    "k": {"default": 0.01, "minimum": 0.0, "unit": "-"},
}
options = {"ghost_penalty": ("off", "on")}
static_options = {"ghost_penalty": "on"}


def residual(
    u, eps_v, w, q, P, ln_J, eps_p, K, mu, h, grad, sum_p, sum_v, dG, facet_mean, jump_n,
    jump_nn, alpha, theta, k, ghost_penalty,
):  # fmt: skip
    """R_u = sum_p V0_p (tau_p f^-T) : grad w
    R_q = sum_p V0_p K_p { q (ln J_f - eps_p - (1 - theta) eps_v) - theta q_i eps_v,i (lumped)
                           - alpha h^2 (K_p/mu_p) grad q . grad eps_v }.
    """
    R_u = sum_p(P, grad(w))
    R_q = sum_p(K * ln_J, q) - sum_p(K * eps_p, q)
    R_q -= sum_p(K, (1 - theta) * q * eps_v) + sum_v(K, theta * q * eps_v)
    if ghost_penalty == "on":
        R_u += k * facet_mean(mu) * h**3 * inner(jump_nn(u), jump_nn(w)) * dG
        R_q -= k * facet_mean(K**2 / mu) * h**3 * jump_n(eps_v) * jump_n(q) * dG
    return R_u + R_q - sum_p(K**2 / mu, alpha * h**2 * dot(grad(q), grad(eps_v)))
