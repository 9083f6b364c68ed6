"""B-bar at finite strain, updated Lagrangian: the volume of the step is ln det f at the cell's centre.

The deviator is tested at the particle, the mean stress with tr(grad w f_c^-1) at the centre.
`ghost_penalty` as in `u_epsv`.
"""

from ufl import inner, inv

from tawami.form import vector

fields = {"u": vector("w")}
kinematics = "cell"
strain = "finite"
parameters = {"k": {"default": 0.01, "minimum": 0.0, "unit": "-"}}
options = {"ghost_penalty": ("off", "on")}
static_options = {"ghost_penalty": "on"}


def residual(
    u, w, P_s, tau_m, mu, h, grad, I, sum_p, sum_c, dG, facet_mean, jump_nn, k,
    ghost_penalty,
):  # fmt: skip
    """R_u(w) = sum_p V0_p { s_p f^-T : grad w + tau_m,p (f_c^-T : grad w)_c } - loads, c the centre."""
    f_c = I + grad(u)
    R_u = sum_p(P_s, grad(w)) + sum_c(tau_m, inner(inv(f_c).T, grad(w)))
    if ghost_penalty == "on":
        R_u += k * facet_mean(mu) * h**3 * inner(jump_nn(u), jump_nn(w)) * dG
    return R_u
