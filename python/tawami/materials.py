"""Material laws: what a driver script passes to a scene."""

from __future__ import annotations

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
    names = {name for name, value in given.items() if value is not None}
    try:
        match E, nu, K, mu, one_minus_2nu:
            case float() | int(), float() | int(), None, None, None:
                return _rust.Material.linear_elastic_e_nu(E, nu)
            case None, None, float() | int(), float() | int(), None:
                return _rust.Material.linear_elastic_k_mu(K, mu)
            case float() | int(), None, None, None, float() | int():
                return _rust.Material.linear_elastic_e_one_minus_2nu(E, one_minus_2nu)
    except InputError as error:
        raise InputError(f"linear_elastic: {error}") from None
    raise InputError(
        f"linear_elastic got {', '.join(sorted(names)) or 'nothing'}: expected the numbers (E, nu), "
        "(K, mu) or (E, one_minus_2nu)"
    )
