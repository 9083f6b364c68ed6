"""Mixed u-eps_v form of Okagawa, Hashimoto and Higo: their eqs. (1) and (2).

eps_v is the elastic volumetric strain, so that the mean stress is a field: sigma_m = old + K eps_v. The
plastic one, eps_p, comes from the law at the particle; without it the form is the paper's.

`stabilisation` chooses the term that replaces alpha h^2 (K/mu) lap(eps_v) of eq. (2):

laplacian       the paper's; imposes d eps_v/dn = 0 weakly on the border of the body
residual_based  the same with the whole momentum residual grad p + div s, p = K eps_v: consistent,
                unsymmetric, small strain, for scenes without body force and inertia, filled cells; up
                to the alpha for which it is coercive (biquadratic 0.144, splines 0.23, bilinear 26)
projection      Dohrmann and Bochev 2004: the part of eps_v that varies within a cell; needs no h^2

`ghost_penalty` ties partially filled cells to their neighbours: jumps of the second normal derivative of
u, whose first is continuous for splines, with the factor k, and of the first of eps_v with k_v, on the
sides that they share. A larger k stiffens the border where u bends, as at the end of a contact; a larger
k_v smooths the mean stress there. Bodies on the lines of the grid have no such cells.
"""

from ufl import dot, inner

from tawami.form import scalar, vector

fields = {"u": vector("w"), "eps_v": scalar("q", role="volumetric_strain")}
parameters = {
    "alpha": {
        "default": 0.01,
        "minimum": 0.0,
        "usual": 1.0,
        "maximum": {"residual_based": 0.14},
        "unit": "-",
        "stabilises": True,
    },
    "k": {"default": 0.003, "minimum": 0.0, "unit": "-", "stabilises": True},
    "k_v": {"default": 0.03, "minimum": 0.0, "unit": "-", "stabilises": True},
}
options = {
    "stabilisation": ("laplacian", "residual_based", "projection"),
    "ghost_penalty": ("on", "off"),
}
whole_cells = ("residual_based",)


def residual(
    u, eps_v, w, q, sigma, eps_p, K, mu, h, grad, div, eps, I, sum_p, cell_mean, dx_c, dG,
    facet_mean, jump_n, jump_nn, alpha, k, k_v, stabilisation, ghost_penalty,
):  # fmt: skip
    """R_u = sum_p V_p sigma_p : grad w
    R_q = sum_p V_p K_p q (div u - eps_v - eps_p) - S.
    """
    R_u = sum_p(sigma, grad(w))
    R_q = sum_p(K, q * (div(u) - eps_v)) - sum_p(K * eps_p, q)
    if ghost_penalty == "on":
        R_u += k * facet_mean(mu) * h**3 * inner(jump_nn(u), jump_nn(w)) * dG
        R_q -= k_v * facet_mean(K**2 / mu) * h**3 * jump_n(eps_v) * jump_n(q) * dG
    if stabilisation == "projection":
        # int (q - q_c) (eps_v - eps_v,c), _c at the centre of the cell
        c = alpha * cell_mean(K**2 / mu)
        twist = grad(grad(q))[0, 1] * grad(grad(eps_v))[0, 1]
        S = c * (h**2 / 12 * dot(grad(q), grad(eps_v)) + h**4 / 144 * twist) * dx_c
        return R_u + R_q - S
    S = sum_p(K**2 / mu, alpha * h**2 * dot(grad(q), grad(eps_v)))
    if stabilisation == "residual_based":
        s_over_mu = 2 * (eps(u) - div(u) / 3 * I)
        S += sum_p(K, alpha * h**2 * dot(grad(q), div(s_over_mu)))
    return R_u + R_q - S
