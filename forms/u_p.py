"""Mixed u-p form: Commend, Truty and Zimmermann 2004. It accepts nu = 0.5 exactly (1/K = 0).

p is the increment of the pressure-like mean stress; sigma is the law's stress without it, that is
the new deviator and the old mean stress. eps_p is the plastic volumetric strain of the law.
"""

from ufl import dot

from tawami.form import scalar, vector

fields = {"u": vector("w"), "p": scalar("q", role="pressure")}
parameters = {
    "alpha": {"default": 0.01, "minimum": 0.0, "usual": 1.0, "unit": "-", "stabilises": True}
}


def residual(u, p, w, q, sigma, eps_p, K, mu, h, grad, div, sum_p, alpha):
    """R_u = sum_p V_p (sigma_p + p I) : grad w
    R_q = sum_p V_p { q (div u - p/K - eps_p) - alpha h^2/mu grad q . grad p }.
    """
    R_u = sum_p(sigma, grad(w)) + sum_p(p * div(w))
    R_q = sum_p(q * div(u)) - sum_p(1 / K, q * p) - sum_p(eps_p, q)
    return R_u + R_q - sum_p(1 / mu, alpha * h**2 * dot(grad(q), grad(p)))
