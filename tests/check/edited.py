"""Forms as users edit them: rate terms, springs, further fields, and their declarations."""

from __future__ import annotations

import ufl
from ufl import dot, inner

import tawami
from tawami.form import scalar, vector

ALONE = {"u": vector("w")}


def form(residual, fields=ALONE, **more):
    return tawami.Form(fields=fields, residual=residual, **more)


def foundation(u, w, sigma, k_s, grad, sum_p):
    return sum_p(sigma, grad(w)) + k_s * sum_p(dot(u, w))


def drag(u, w, sigma, dt, c_d, grad, sum_p):
    return sum_p(sigma, grad(w)) + c_d * sum_p(dot(u, w) / dt)


def viscosity(u, w, sigma, dt, eta, eps, grad, sum_p):
    return sum_p(sigma, grad(w)) + sum_p(2 * eta * inner(eps(u) / dt, eps(w)))


def viscosity_of_rotations(u, w, sigma, dt, eta, grad, sum_p):
    return sum_p(sigma, grad(w)) + sum_p(eta * inner(grad(u) / dt, grad(w)))


def operators_of_ufl(w, sigma, sum_p):
    return sum_p(sigma, ufl.grad(w))


def consolidation(u, p_w, w, r, sigma, kappa, mu_w, dt, old, grad, div, sum_p):
    p = old.p_w + p_w
    R_u = sum_p(inner(sigma, grad(w)) - p * div(w))
    return R_u - sum_p(r * div(u)) - sum_p(dt * kappa / mu_w * dot(grad(r), grad(p)))


def conduction(theta, w, r, sigma, c, k, dt, old, grad, sum_p):
    T = old.theta + theta
    R_u = sum_p(inner(sigma, grad(w)))
    return R_u + sum_p(c * theta * r + dt * k * dot(grad(T), grad(r)))


def conduction_backwards(theta, w, r, sigma, c, k, dt, old, grad, sum_p):
    T = old.theta + theta
    R_u = sum_p(inner(sigma, grad(w)))
    return R_u + sum_p(c * theta * r - dt * k * dot(grad(T), grad(r)))


def conduction_of_increments(theta, w, r, sigma, c, k, dt, grad, sum_p):
    R_u = sum_p(inner(sigma, grad(w)))
    return R_u + sum_p(c * theta / dt * r + k * dot(grad(theta), grad(r)))


def expansion(of):
    """A mixed form with conduction, whose volume follows the value or the increment of theta."""

    def residual(u, eps_v, theta, w, q, r, sigma, K, c, k, a, dt, old, grad, div, sum_p):
        T = old.theta + theta
        acts = {"value": T, "increment": theta, "rate": theta + dt * old.theta}[of]
        R_q = sum_p(K * q * (div(u) - eps_v - 3 * a * acts))
        R_u = sum_p(inner(sigma, grad(w)))
        return R_u + R_q + sum_p(c * theta * r + dt * k * dot(grad(T), grad(r)))

    return residual


def damage(d, w, r, sigma, G_c, old, grad, sum_p, h):
    D = old.d + d
    R_u = sum_p((1 - D) ** 2 * inner(sigma, grad(w)))
    return R_u + sum_p(G_c * (D * r / h + h * dot(grad(D), grad(r))))


def without_dt(theta, w, r, sigma, c, k, old, grad, sum_p):
    R_u = sum_p(inner(sigma, grad(w)))
    return R_u + sum_p(c * theta * r) + sum_p(k * dot(grad(old.theta + theta), grad(r)))


HEAT = {
    "fields": ALONE | {"theta": scalar("r", unit="K")},
    "parameters": {
        "c": {"default": 2e6, "unit": "J/(m3 K)"}, "k": {"default": 1.5, "unit": "W/(m K)"}
    },
}  # fmt: skip
EXPANSION = {
    "fields": {
        "u": vector("w"), "eps_v": scalar("q", role="volumetric_strain"), "theta": scalar("r", unit="K")
    },
    "parameters": {**HEAT["parameters"], "a": {"default": 1e-5, "unit": "1/K"}},
}  # fmt: skip
WATER = {
    "fields": ALONE | {"p_w": scalar("r", unit="Pa")},
    "data": {"kappa": "permeability [m2]"},
    "parameters": {"mu_w": {"default": 1e-3, "unit": "Pa s"}},
}
VISCOUS = {"parameters": {"eta": {"default": 1e9, "unit": "Pa s"}}}
