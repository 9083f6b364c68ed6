"""Plastic laws in scenes: rejected parameters, history by name, a block beyond its yield stress."""

from __future__ import annotations

import numpy as np
import pytest
from scenes import FINITE, FORMS, grid_of
from ufl import div, grad

import tawami
from tawami.form import scalar, vector

ELASTIC = tawami.linear_elastic(E=100.0, nu=0.3)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"phi": 90.0}, "phi = 90: expected a friction angle in degrees, 0 <= phi < 90"),
        ({"phi": 0.38}, "phi = 0.38: expected degrees: below 1.6 it looks like radians"),
        ({"phi": 20.0, "psi": 25.0}, "psi = 25: expected a dilatancy angle in degrees"),
        ({"phi": 20.0, "c": -1.0}, "c = -1: expected a cohesion"),
        ({"phi": 0.0}, "c = 0: expected a positive cohesion where phi = 0"),
        ({"phi": 20.0, "eps_v_max": -1.0}, "eps_v_max = -1: expected a plastic volumetric strain"),
        ({"phi": "steep"}, ""),
    ],
)
@pytest.mark.parametrize("law", [tawami.drucker_prager, tawami.mohr_coulomb])
def test_wrong_angles_give_an_error_message(law, options, words):
    with pytest.raises(tawami.InputError) as error:
        law(ELASTIC, **options)
    assert f"{law.__name__}: {words}" in str(error.value)


def test_wrong_parameters_of_von_mises_are_rejected():
    with pytest.raises(tawami.InputError, match="yield_stress = 0: expected a positive"):
        tawami.von_mises(ELASTIC, yield_stress=0.0)
    with pytest.raises(tawami.InputError, match="expected a material of linear_elastic"):
        tawami.von_mises({"E": 1.0}, yield_stress=1.0)
    with pytest.raises(tawami.InputError, match="a positive, finite modulus"):
        tawami.von_mises(tawami.linear_elastic(E=1.0, nu=0.5), yield_stress=1.0)


@pytest.mark.parametrize("path", ["points", "dolfinx"])
@pytest.mark.parametrize(
    "options", [FORMS["u"], FORMS["u_epsv"], FORMS["u_bbar"], *FINITE.values()]
)
def test_the_tangent_is_the_difference_of_the_residual(options, path):
    grid = grid_of()
    random = np.random.default_rng(0)
    x = grid.origin + grid.h * np.array(grid.cells) * random.random((80, 2))
    laws = [
        tawami.von_mises(ELASTIC, yield_stress=0.4, hardening=5.0),
        tawami.drucker_prager(ELASTIC, phi=30.0, c=0.2, psi=10.0),
        tawami.mohr_coulomb(ELASTIC, phi=30.0, c=0.2, psi=10.0),
        tawami.mohr_coulomb(ELASTIC, phi=0.0, c=0.2),
        tawami.cam_clay(ELASTIC, M=1.0, lambda_star=0.1, kappa_star=0.02, preconsolidation=0.4),
    ]
    body = tawami.Body(x, np.full(80, 0.05))
    numbers = random.integers(0, len(laws), 80)
    scene = tawami.Scene(grid, body, laws, material_of=numbers, assembly=path, **options)
    c = 0.02 * random.standard_normal(scene.num_coefficients)
    direction = random.standard_normal(len(c))
    tangent = scene.tangent(c) @ direction
    h = 1e-8
    difference = (scene.residual(c + h * direction) - scene.residual(c - h * direction)) / (2 * h)
    assert np.abs(tangent - difference).max() < 1e-4 * np.abs(tangent).max()


@pytest.mark.parametrize("form", ["u", "u_epsv"])
def test_a_block_in_plane_compression_yields_at_its_limit(form):
    """Hardening, nu near 0.5, free sides: on the yield surface, and near the limit of plane strain."""
    sigma_y, hardening = 1.0, 2.0
    grid = grid_of((4, 2))
    body = tawami.box(grid, grid.origin, grid.upper, per_axis=3, gauss=True)
    elastic = tawami.linear_elastic(E=100.0, nu=0.49)
    law = tawami.von_mises(elastic, yield_stress=sigma_y, hardening=hardening)
    scene = tawami.Scene(grid, body, law, form=form)
    scene.fix("left", "x")
    scene.fix("bottom", "y")
    assert scene.particles.history_names == ["plastic_strain"]
    plate = scene.fix("right", "x", 0.0)
    for k in range(1, 9):
        plate.change(-0.01 * k)
        solution = scene.solve()
    plastic = scene.particles.history("plastic_strain")
    assert (plastic > 0.02).all()
    s = solution.stress.copy()
    s[:, :3] -= solution.mean_stress[:, None]
    q = np.sqrt(1.5 * ((s[:, :3] ** 2).sum(axis=1) + 2 * s[:, 3] ** 2))
    assert q == pytest.approx(sigma_y + hardening * plastic, rel=1e-9)
    assert solution.stress[:, 0] == pytest.approx(-2 / np.sqrt(3) * q, rel=1e-3)
    assert np.abs(solution.stress[:, 1]).max() < 1e-4
    with pytest.raises(tawami.InputError, match="history 'damage': the laws of this scene have"):
        scene.particles.history("damage")


@pytest.mark.parametrize("law", [tawami.drucker_prager, tawami.mohr_coulomb])
def test_flow_that_changes_the_volume_needs_a_term_in_the_form(law):
    grid = grid_of()
    body = tawami.box(grid, grid.origin, grid.upper, per_axis=2)
    fields = {"u": vector("w"), "eps_v": scalar("q", role="volumetric_strain")}

    def paper(u, eps_v, w, q, sigma, K, sum_p):
        return sum_p(sigma, grad(w)) + sum_p(K, q * (div(u) - eps_v))

    form = tawami.Form(fields, paper)
    with pytest.raises(tawami.InputError, match="expected eps_p in its volume equation"):
        tawami.Scene(grid, body, law(ELASTIC, phi=30.0), form=form)
    tawami.Scene(grid, body, tawami.von_mises(ELASTIC, yield_stress=1.0), form=form)


@pytest.mark.parametrize("law", [tawami.drucker_prager, tawami.mohr_coulomb])
def test_u_p_equals_u_epsv_without_stabilisation(law):
    """p = K eps_v, so that both forms have the same solution."""
    settled = []
    for form in ("u_epsv", "u_p"):
        grid = grid_of()
        body = tawami.box(grid, grid.origin, grid.upper, per_axis=3)
        material = law(ELASTIC, phi=20.0, psi=10.0, c=0.01)
        scene = tawami.Scene(grid, body, material, form=form, alpha=0.0, tolerance=1e-12)
        for edge, component in (("left", "x"), ("bottom", "x"), ("bottom", "y")):
            scene.fix(edge, component)
        scene.fix("top", "y", -0.005)
        settled.append(scene.solve().reaction("top"))
        assert scene.particles.history("plastic_strain").max() > 0
    assert settled[1] == pytest.approx(settled[0], rel=1e-9)
