"""A form with a field of its own besides displacement and volumetric strain: heat."""

from __future__ import annotations

from ufl import div, dot, grad

from tawami.form import Form, scalar, vector

#: Capacity, conductivity, thermal expansion, strength of the source, heat of compression.
PARAMETERS = {"c": 0.7, "k": 0.3, "beta": 0.2, "source": 0.4, "a": 0.5}


def heat(u, theta, w, r, K, sum_p, c, k, beta, source, a):
    """Conduction, expansion, and heat of compression: linear, with all blocks."""
    expansion = -sum_p(K, beta * theta * div(w))
    return expansion + sum_p(
        c * theta * r + k * dot(grad(theta), grad(r)) + a * div(u) * r - source * r
    )


def residual(u, theta, eps_v, w, r, q, sigma, K, sum_p, c, k, beta, source, a):
    volume = sum_p(K, q * (div(u) - eps_v))
    momentum = sum_p(sigma, grad(w))
    return momentum + volume + heat(u, theta, w, r, K, sum_p, c, k, beta, source, a)


def form_of(residual=residual, basis="bilinear", scale=None, **values) -> Form:
    """The volumetric strain is the last field: its role decides, not its position."""
    fields = {
        "u": vector("w"),
        "theta": scalar("r", basis=basis, unit="K", scale=scale),
        "eps_v": scalar("q", role="volumetric_strain"),
    }
    parameters = {n: {"default": v} for n, v in (PARAMETERS | values).items()}
    return Form(fields, residual, parameters=parameters)
