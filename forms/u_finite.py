"""Displacement only at finite strain, updated Lagrangian. It locks near nu = 0.5.

`ghost_penalty` as in `u_epsv`.
"""

from ufl import inner

from tawami.form import vector

fields = {"u": vector("w")}
strain = "finite"
parameters = {"k": {"default": 0.01, "minimum": 0.0, "unit": "-"}}
options = {"ghost_penalty": ("off", "on")}
static_options = {"ghost_penalty": "on"}


def residual(u, w, P, mu, h, grad, sum_p, dG, facet_mean, jump_nn, k, ghost_penalty):
    """R_u(w) = sum_p V0_p (tau_p f^-T) : grad w, P = tau f^-T."""
    R_u = sum_p(P, grad(w))
    if ghost_penalty == "on":
        R_u += k * facet_mean(mu) * h**3 * inner(jump_nn(u), jump_nn(w)) * dG
    return R_u
