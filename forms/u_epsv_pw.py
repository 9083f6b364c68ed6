"""Consolidation at small strain (Biot 1941): `u_epsv` for the skeleton, with water in its pores.

sigma is the effective stress, p_w the pore pressure, pressure positive. The water obeys Darcy's law,

    q_w = -(kappa/mu_w) (grad p_w - rho_w b),

and its balance is integrated with backward Euler. `storage` is what the water's compressibility adds,
n/K_w; 0 for water and grains that do not change their volume. The density of the scene is that of the
saturated soil. A flux of p_w is the water that enters, in m/s.

alpha_w stabilises p_w (Truty and Zimmermann 2006): it acts on the increment and vanishes with h. Without
it p_w oscillates near drains while T_v = c_v t/h^2 < 1/6 (Vermeer and Verruijt 1981).
"""

from ufl import dot, inner

from tawami.form import scalar, vector

fields = {
    "u": vector("w"),
    "eps_v": scalar("q", role="volumetric_strain"),
    "p_w": scalar("r", unit="Pa"),
}
data = {"kappa": "permeability [m2]"}
parameters = {
    "alpha": {"default": 0.01, "minimum": 0.0, "usual": 1.0, "unit": "-"},
    "alpha_w": {"default": 1 / 6, "minimum": 0.0, "usual": 1.0, "unit": "-"},
    "biot": {"default": 1.0, "minimum": 0.0, "maximum": 1.0, "unit": "-"},
    "storage": {"default": 0.0, "minimum": 0.0, "unit": "1/Pa"},
    "mu_w": {"default": 1e-3, "minimum": 0.0, "unit": "Pa s"},
    "rho_w": {"default": 1e3, "minimum": 0.0, "unit": "kg/m3"},
}


def residual(
    u, eps_v, p_w, w, q, r, sigma, eps_p, K, mu, b, h, dt, old, grad, div, sum_p, kappa, alpha,
    alpha_w, biot, storage, mu_w, rho_w,
):  # fmt: skip
    """R_u = sum_p V_p { sigma_p : grad w - biot p div w },  p = old p_w + p_w
    R_q = sum_p V_p K_p { q (div u - eps_v - eps_p) - alpha h^2 (K_p/mu_p) grad q . grad eps_v }
    R_r = sum_p V_p { r (biot div u + storage p_w)/dt + kappa/mu_w grad r . (grad p - rho_w b)
                      + alpha_w h^2/(K_p + 4 mu_p/3) grad r . grad p_w / dt }.
    """
    p = old.p_w + p_w
    R_u = sum_p(inner(sigma, grad(w)) - biot * p * div(w))
    R_q = sum_p(K * q * (div(u) - eps_v - eps_p))
    R_q -= sum_p(K**2 / mu * alpha * h**2 * dot(grad(q), grad(eps_v)))
    R_r = sum_p(r * (biot * div(u) + storage * p_w) / dt)
    weight = sum(rho_w * b[i] * grad(r)[i] for i in range(len(b)))
    R_r += sum_p(kappa / mu_w * (dot(grad(r), grad(p)) - weight))
    R_r += sum_p(alpha_w * h**2 / (K + 4 * mu / 3) * dot(grad(r), grad(p_w)) / dt)
    return R_u + R_q + R_r
