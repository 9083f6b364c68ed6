"""Displacement only at finite strain, updated Lagrangian. It locks near nu = 0.5."""

from ufl import dot, grad

fields = {"u": ("displacement", "w")}
kinematics = "displacement"
strain = "finite"


def residual(w, P, t, sum_p, ds):
    """R_u(w) = sum_p V0_p (tau_p f^-T) : grad w - int t . w ds, P = tau f^-T."""
    return sum_p(P, grad(w)) - dot(t, w) * ds
