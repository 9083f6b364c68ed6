"""Material laws: what a driver script passes to a scene."""

from __future__ import annotations

from collections.abc import Callable
from numbers import Real

from tawami import _rust
from tawami.errors import InputError


def linear_elastic(
    *,
    E: float | None = None,
    nu: float | None = None,
    K: float | None = None,
    mu: float | None = None,
    one_minus_2nu: float | None = None,
) -> _rust.Material:
    """Isotropic linear elasticity: `s = 2 mu dev(eps)`, `sigma_m = K eps_v`.

    Give (E, nu), (K, mu), or (E, one_minus_2nu); the last keeps its digits near nu = 0.5.

    Args:
        E: Young's modulus [Pa].
        nu: Poisson's ratio, -1 < nu <= 0.5; 0.5 with form 'u_p' only.
        K: Bulk modulus [Pa].
        mu: Shear modulus [Pa].
        one_minus_2nu: 1 - 2 nu, from 0 (with form 'u_p' only) to below 3.

    Raises:
        InputError: A parameter out of its range, or another combination.
    """
    given = {"E": E, "nu": nu, "K": K, "mu": mu, "one_minus_2nu": one_minus_2nu}
    values = {name: value for name, value in given.items() if value is not None}
    makers: dict[tuple[str, ...], Callable[[float, float], _rust.Material]] = {
        ("E", "nu"): _rust.Material.linear_elastic_e_nu,
        ("K", "mu"): _rust.Material.linear_elastic_k_mu,
        ("E", "one_minus_2nu"): _rust.Material.linear_elastic_e_one_minus_2nu,
    }
    if tuple(values) not in makers:
        raise InputError(
            f"linear_elastic got {', '.join(values) or 'nothing'}: expected (E, nu), (K, mu) or "
            "(E, one_minus_2nu)"
        )
    for name, value in values.items():
        if not isinstance(value, Real):
            raise InputError(f"linear_elastic: {name} = {value!r}: expected a number")
    first, second = (float(value) for value in values.values())
    try:
        return makers[tuple(values)](first, second)
    except InputError as error:
        raise InputError(f"linear_elastic: {error}") from None
