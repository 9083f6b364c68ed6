"""Displacement only. It locks near nu = 0.5: for comparison, and for compressible materials."""

from tawami.form import vector

fields = {"u": vector("w")}


def residual(w, sigma, grad, sum_p):
    """R_u(w) = sum_p V_p sigma_p : grad w."""
    return sum_p(sigma, grad(w))
