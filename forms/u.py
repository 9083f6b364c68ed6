"""Displacement only. It locks near nu = 0.5: for comparison, and for compressible materials."""

from ufl import dot

from tawami.form import vector

fields = {"u": vector("w")}


def residual(w, sigma, t, grad, sum_p, ds):
    """R_u(w) = sum_p V_p sigma_p : grad w - int t . w ds."""
    return sum_p(sigma, grad(w)) - dot(t, w) * ds
