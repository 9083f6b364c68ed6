"""B-bar: volumetric part at the centre of the particle's cell, deviator at the particle.

Talbot et al. 2024; the three-dimensional (factor 1/3) form of plane strain.
"""

from tawami.form import vector

fields = {"u": vector("w")}
kinematics = "cell"


def residual(w, s, sigma_m, grad, div, sum_p, sum_c):
    """R_u(w) = sum_p V_p { s_p : grad w + sigma_m,p (div w at the cell centre) }."""
    return sum_p(s, grad(w)) + sum_c(sigma_m, div(w))
