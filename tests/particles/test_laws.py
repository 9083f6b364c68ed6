"""Laws by their names."""

import numpy as np
import pytest
from scenes import grid_of

import tawami

ELASTIC = tawami.linear_elastic(E=1e6, nu=0.3)


@pytest.mark.parametrize(
    ("by_name", "function"),
    [
        (tawami.law("neo_hookean", ELASTIC), tawami.neo_hookean(E=1e6, nu=0.3)),
        (
            tawami.law("von_mises", ELASTIC, yield_stress=1e3),
            tawami.von_mises(ELASTIC, yield_stress=1e3),
        ),
        (
            tawami.law("mohr_coulomb", ELASTIC, psi=5.0, phi=30.0),
            tawami.mohr_coulomb(ELASTIC, phi=30.0, psi=5.0),
        ),
        (
            tawami.law(
                "cam_clay", ELASTIC, M=1.0, lambda_star=0.2, kappa_star=0, preconsolidation=2.0
            ),
            tawami.cam_clay(ELASTIC, M=1.0, lambda_star=0.2, kappa_star=0, preconsolidation=2.0),
        ),
        (
            tawami.law("drucker_prager", ELASTIC, phi=1.0, tiny_angle=True, c=1.0),
            tawami.drucker_prager(ELASTIC, phi=1.0, c=1.0, tiny_angle=True),
        ),
    ],
)
def test_a_law_by_its_name_is_that_of_its_function(by_name, function):
    assert repr(by_name) == repr(function)
    assert by_name.name == function.name


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: tawami.law("von_misses", ELASTIC), r"^law = 'von_misses': expected one of 'line"),
        (
            lambda: tawami.law("von_mises", ELASTIC),
            r"^von_mises got the parameters none: expected yield_stress, hardening \(optional\)$",
        ),
        (
            lambda: tawami.law("von_mises", ELASTIC, yield_stress=1.0, nu=0.3),
            r"^von_mises got the parameters yield_stress, nu: expected yield_stress, hardening",
        ),
        (
            lambda: tawami.law("von_mises", tawami.neo_hookean(E=1e6, nu=0.3), yield_stress=1.0),
            r"^von_mises: elastic = .*: expected a material of linear_elastic\(...\)$",
        ),
        (
            lambda: tawami.law("von_mises", ELASTIC, yield_stress=-1.0),
            r"^von_mises: yield_stress = -1: expected a positive, finite yield stress in Pa",
        ),
    ],
)
def test_a_wrong_law_or_parameter_is_named(make, message):
    with pytest.raises(tawami.InputError, match=message):
        make()


def test_several_laws_need_the_number_of_each_particle():
    grid = grid_of()
    body = tawami.box(grid, grid.origin, grid.upper, per_axis=2)
    laws = [tawami.linear_elastic(E=E, nu=0.3) for E in (1.0, 2.0)]
    with pytest.raises(tawami.InputError, match="2 materials, and nothing says which particle"):
        tawami.Scene(grid, body, laws)
    numbers = np.arange(len(body.x)) % 2
    assert len(tawami.Scene(grid, body, laws, material_of=numbers).laws) == 2
