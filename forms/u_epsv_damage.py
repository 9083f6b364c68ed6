"""Phase-field fracture (AT2: Bourdin, Francfort and Marigo 2000): `u_epsv` with a damage d.

The energy per volume, with psi the elastic energy of the law's stress sigma, is

    g(d) psi + G_c (d^2/(2 l) + l/2 |grad d|^2),    g(d) = (1 - d)^2 + k.

g sigma is the stress of the body; particles carry sigma. Cracks do not heal: d follows the largest psi
so far, H (Miehe, Hofacker and Welschinger 2010), which the script gives after each solve,

    psi = (s : s)/(4 mu) + sigma_m^2/(2 K),    scene.data("H", np.maximum(H, psi)),

until d stands still. A large H at the start is a crack. Tension and compression are damaged alike.
"""

from ufl import dot, inner

from tawami.form import scalar, vector

fields = {
    "u": vector("w"),
    "eps_v": scalar("q", role="volumetric_strain"),
    "d": scalar("r", unit="-"),
}
data = {
    "H": "largest elastic energy so far [J/m3]",
    "G_c": "fracture energy [J/m2]",
    "l": "length of the phase field [m]",
}
parameters = {
    "alpha": {"default": 0.01, "minimum": 0.0, "usual": 1.0, "unit": "-"},
    "k": {"default": 1e-6, "minimum": 0.0, "unit": "-"},
}


def residual(
    u, eps_v, d, w, q, r, sigma, eps_p, K, mu, h, old, grad, div, sum_p, H, G_c, l, alpha, k
):  # fmt: skip
    """With D = old d + d:

    R_u = sum_p V_p g(D) sigma_p : grad w
    R_q = that of u_epsv
    R_r = sum_p V_p { (G_c/l D - 2 (1 - D) H) r + G_c l grad D . grad r }.
    """
    D = old.d + d
    R_u = sum_p(((1 - D) ** 2 + k) * inner(sigma, grad(w)))
    R_q = sum_p(K * q * (div(u) - eps_v - eps_p))
    R_q -= sum_p(K**2 / mu * alpha * h**2 * dot(grad(q), grad(eps_v)))
    R_r = sum_p((G_c / l * D - 2 * (1 - D) * H) * r + G_c * l * dot(grad(D), grad(r)))
    return R_u + R_q + R_r
