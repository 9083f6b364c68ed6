"""Mixed u-eps_v form at finite strain, updated Lagrangian: the law receives (exp(eps_v)/J_f)^(1/3) f.

ln J_f is taken at the particles, as all that is nonlinear in the unknowns. V0, the volume at the start
of the scene, in both equations keeps the elastic tangent symmetric. theta lumps a share of the mass of
eps_v: one particle alone in a cell makes the consistent mass singular; constants are unchanged by it.
"""

from ufl import dot, grad

fields = {"u": ("displacement", "w"), "eps_v": ("volumetric_strain", "q")}
kinematics = "mixed"
strain = "finite"
parameters = {
    "alpha": {"default": 0.1, "minimum": 0.0},
    "theta": {"default": 0.01, "minimum": 0.0, "maximum": 1.0},
}


def residual(eps_v, w, q, P, ln_J, K, mu, t, h, sum_p, sum_v, ds, alpha, theta):
    """R_u = sum_p V0_p (tau_p f^-T) : grad w - int t . w ds
    R_q = sum_p V0_p K_p { q (ln J_f - (1 - theta) eps_v) - theta q_i eps_v,i (lumped)
                           - alpha h^2 (K_p/mu_p) grad q . grad eps_v }.
    """
    R_u = sum_p(P, grad(w)) - dot(t, w) * ds
    R_q = sum_p(K * ln_J, q) - sum_p(K, (1 - theta) * q * eps_v) - sum_v(K, theta * q * eps_v)
    return R_u + R_q - sum_p(K**2 / mu, alpha * h**2 * dot(grad(q), grad(eps_v)))
