"""Material laws for driver scripts."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from tawami import _rust
from tawami.base import checks
from tawami.base.errors import InputError


def linear_elastic(
    *,
    E: float | None = None,
    nu: float | None = None,
    K: float | None = None,
    mu: float | None = None,
    one_minus_2nu: float | None = None,
) -> _rust.Material:
    """Isotropic linear elasticity: `s = 2 mu dev(eps)`, `sigma_m = K eps_v`.

    Give (E, nu), (K, mu), or (E, one_minus_2nu). The last keeps all digits near nu = 0.5.

    Args:
        E: Young's modulus [Pa].
        nu: Poisson's ratio, -1 < nu <= 0.5; 0.5 only with form 'u_p'.
        K: Bulk modulus [Pa].
        mu: Shear modulus [Pa].
        one_minus_2nu: 1 - 2 nu, from 0 (only with form 'u_p') to below 3.

    Raises:
        InputError: A parameter is out of its range, or the combination is another one.
    """
    return _elastic("linear_elastic", E=E, nu=nu, K=K, mu=mu, one_minus_2nu=one_minus_2nu)


def neo_hookean(
    *,
    E: float | None = None,
    nu: float | None = None,
    K: float | None = None,
    mu: float | None = None,
    one_minus_2nu: float | None = None,
) -> _rust.Material:
    """Neo-Hookean elasticity: `tau = mu dev(be_bar) + K ln J I`, be_bar = J^(-2/3) F F^T.

    This law exists at finite strain only. Give its constants at small strain as (E, nu), (K, mu), or
    (E, one_minus_2nu). The last keeps all digits near nu = 0.5.

    Args:
        E: Young's modulus [Pa].
        nu: Poisson's ratio, -1 < nu < 0.5.
        K: Bulk modulus [Pa].
        mu: Shear modulus [Pa].
        one_minus_2nu: 1 - 2 nu, above 0 and below 3.

    Raises:
        InputError: A parameter is out of its range, or the combination is another one.
    """
    name = "neo_hookean"
    return law(name, _elastic(name, E=E, nu=nu, K=K, mu=mu, one_minus_2nu=one_minus_2nu))


def von_mises(
    elastic: _rust.Material, *, yield_stress: float, hardening: float = 0.0
) -> _rust.Material:
    """Von Mises plasticity: `q = sqrt(3 J2) <= yield_stress + hardening * plastic_strain`.

    Args:
        elastic: Elastic part, a material of linear_elastic(...) with nu < 0.5.
        yield_stress: Yield stress in uniaxial tension [Pa].
        hardening: Hardening modulus [Pa].

    History: `plastic_strain`, the equivalent plastic strain.

    Raises:
        InputError: A parameter is out of its range.
    """
    return law("von_mises", elastic, yield_stress=yield_stress, hardening=hardening)


def drucker_prager(
    elastic: _rust.Material,
    *,
    phi: float,
    c: float = 0.0,
    psi: float = 0.0,
    eps_v_max: float = math.inf,
    tiny_angle: bool = False,
) -> _rust.Material:
    """Drucker-Prager plasticity whose limit states in plane strain are those of Mohr-Coulomb.

    Args:
        elastic: Elastic part, a material of linear_elastic(...) with nu < 0.5.
        phi: Friction angle [degrees].
        c: Cohesion [Pa].
        psi: Dilatancy angle [degrees], at most phi.
        eps_v_max: Plastic volumetric strain at which dilatancy ends; the strength remains that of psi.
        tiny_angle: Accept a friction angle between 0 and 1.6 degrees. It is rejected otherwise, because
            it may be in radians.

    History: `plastic_strain`, the multiplier of sqrt(J2); `dilatancy`, the plastic volumetric strain.

    Raises:
        InputError: A parameter is out of its range.
    """
    angles = {"phi": phi, "psi": psi, "tiny_angle": tiny_angle}
    return law("drucker_prager", elastic, c=c, eps_v_max=eps_v_max, **angles)


def mohr_coulomb(
    elastic: _rust.Material,
    *,
    phi: float,
    c: float = 0.0,
    psi: float = 0.0,
    eps_v_max: float = math.inf,
    tiny_angle: bool = False,
) -> _rust.Material:
    """Mohr-Coulomb plasticity: `s1 - s3 + (s1 + s3) sin phi <= 2 c cos phi`.

    s1 >= s2 >= s3 are the principal stresses, tension positive. With phi = 0 this is Tresca plasticity.

    Args:
        elastic: Elastic part, a material of linear_elastic(...) with nu < 0.5.
        phi: Friction angle [degrees].
        c: Cohesion [Pa]; with phi = 0 the undrained strength s_u.
        psi: Dilatancy angle [degrees], at most phi.
        eps_v_max: Plastic volumetric strain at which dilatancy ends; the strength does not change.
        tiny_angle: Accept a friction angle between 0 and 1.6 degrees. It is rejected otherwise, because
            it may be in radians.

    History: `plastic_strain`, the sum over the steps of the greatest plastic shear (gamma: largest minus
    smallest principal value of the plastic strain of the step); `dilatancy`, the plastic volumetric
    strain without the part that opens at the apex.

    Raises:
        InputError: A parameter is out of its range.
    """
    angles = {"phi": phi, "psi": psi, "tiny_angle": tiny_angle}
    return law("mohr_coulomb", elastic, c=c, eps_v_max=eps_v_max, **angles)


def cam_clay(
    elastic: _rust.Material,
    *,
    M: float,
    lambda_star: float,
    kappa_star: float,
    preconsolidation: float,
    tension: float = 0.01,
) -> _rust.Material:
    """Modified Cam-Clay: `q^2 / M^2 + (p + p_t) (p - p_c) <= 0`, associated flow.

    p is the mean stress, compression positive, q = sqrt(3/2 s : s), p_t = tension * preconsolidation.
    With plastic compression v, d ln p_c = d v / (lambda_star - kappa_star) (Roscoe and Burland 1968;
    Butterfield 1979). Dry of critical, 2 p < p_c - p_t, the clay softens until p_c = p_t, and results
    depend on the grid.

    Args:
        elastic: Elastic part, a material of linear_elastic(...) with nu < 0.5. K and mu are constant:
            kappa_star occurs only in the difference to lambda_star. K = p / kappa_star at the pressure p
            where both should agree.
        M: Slope q / p of the critical state line.
        lambda_star: Slope - d ln(volume) / d ln p of virgin compression.
        kappa_star: The same slope of swelling, smaller than lambda_star.
        preconsolidation: p_c [Pa] of particles that scene.initial("preconsolidation", ...) gave none.
        tension: Isotropic tensile strength as a share of preconsolidation, above 0 and at most 1. With a
            small share, mixed forms need more iterations where the clay opens.

    History: `preconsolidation`, p_c [Pa], where 0 stands for the parameter; `plastic_strain`, the sum of
    sqrt(2/3 e : e) over the steps, e the plastic deviatoric strain of a step.

    Raises:
        InputError: A parameter is out of its range.
    """
    slopes = {"M": M, "lambda_star": lambda_star, "kappa_star": kappa_star}
    return law("cam_clay", elastic, preconsolidation=preconsolidation, tension=tension, **slopes)


def law(name: str, elastic: _rust.Material, **parameters: float) -> _rust.Material:
    """A law by its name: how a driver script uses a law that was added in Rust.

    Args:
        name: Name of the law, as in its `MAKER` in `rust/law`.
        elastic: Elastic part, a material of linear_elastic(...) with nu < 0.5.
        parameters: The parameters that the law declares, in SI units.

    Raises:
        InputError: There is no such law or parameter, a parameter without a default is missing, or a
            value is out of its range.
    """
    laws = _rust.parameters()
    expected = laws[checks.choice("law", name, laws)]
    moduli = _moduli(name, elastic)
    required = [own for own, default in expected.items() if default is None]
    if parameters.keys() - expected.keys() or set(required) - parameters.keys():
        names = [own if own in required else f"{own} (optional)" for own in expected]
        raise InputError(
            f"{name} got the parameters {', '.join(parameters) or 'none'}: expected "
            f"{', '.join(names) or 'none'}"
        )
    given = expected | parameters
    values = [
        (checks.switch if default is False else checks.real)(f"{name}: {own}", given[own])
        for own, default in expected.items()
    ]
    return _made(name, _rust.Material.of, name, moduli, values)


def _elastic(law: str, **given: float | None) -> _rust.Material:
    """The linear elastic law of two constants that `law` received."""
    values = {name: value for name, value in given.items() if value is not None}
    makers: dict[tuple[str, ...], Callable[[float, float], _rust.Material]] = {
        ("E", "nu"): _rust.Material.linear_elastic_e_nu,
        ("K", "mu"): lambda K, mu: _rust.Material.of("linear_elastic", (K, mu), []),
        ("E", "one_minus_2nu"): _rust.Material.linear_elastic_e_one_minus_2nu,
    }
    if tuple(values) not in makers:
        raise InputError(
            f"{law} got {', '.join(values) or 'nothing'}: expected (E, nu), (K, mu) or "
            "(E, one_minus_2nu)"
        )
    first, second = (checks.real(f"{law}: {name}", value) for name, value in values.items())
    return _made(law, makers[tuple(values)], first, second)


def _moduli(name: str, elastic: Any) -> tuple[float, float]:
    if not isinstance(elastic, _rust.Material) or elastic.finite_only:
        raise InputError(
            f"{name}: elastic = {checks.shown(elastic)}: expected a material of linear_elastic(...)"
        )
    return elastic.bulk_modulus, elastic.shear_modulus


def _made(name: str, make: Callable[..., _rust.Material], *parameters: Any) -> _rust.Material:
    try:
        return make(*parameters)
    except InputError as error:
        raise InputError(f"{name}: {error}") from None
