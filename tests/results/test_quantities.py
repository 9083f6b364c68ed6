"""Quantities of outputs; those that a scene does not have are rejected by name."""

from __future__ import annotations

import pytest
from runs import plastic_block, static_scene

import tawami

P, G, T = tawami.ParticleOutput, tawami.GridOutput, tawami.TableOutput


@pytest.mark.parametrize(
    ("output", "message"),
    [
        (P("velocity"), r"velocity: a scene by itself is static.*Dynamics\(scene, velocity"),
        (
            P("plastic_strain"),
            r"'plastic_strain': the laws of this scene have no history: .*von_mises",
        ),
        (P("eps_v"), r"eps_v: .*expected one with.*form='u_epsv'"),
        (G("velocity"), r"velocity: a scene by itself is static"),
        (G("mean stress", "dilatancy"), "'dilatancy': the laws of this scene have no history"),
        (G("eps_v"), r"eps_v: .*form='u_epsv'"),
        (G("p"), r"p: form 'u' has no pressure: expected form='u_p'"),
        (T("energies"), r"energies: a scene by itself is static"),
        (T("momentum"), r"momentum needs a velocity: a scene by itself is static"),
    ],
)
def test_a_quantity_that_is_not_modelled_is_rejected(output, message, tmp_path):
    with pytest.raises(tawami.NotModelledError, match=message):
        output.begin(tmp_path, static_scene("u"), None)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("output", "message"),
    [
        (P("strss"), "particles: 'strss' is unknown: expected one of displacement, stress, mean str"),
        (G("number"), "grid: 'number' is unknown: expected one of displacement, velocity, reaction"),
        (T("energy"), "table: 'energy' is unknown: expected one of energies, momentum"),
        (T("reaction top"), r"reaction\('top'\): nothing supports .* expected one of 'left'"),
        (T("reaction (1, 1)"), r"reaction \(1, 1\): no point is held there: expected hold\(\(1.0, 1"),
        (T("displacement (9, 0)"), r"displacement \(9, 0\): expected a point within the grid"),
        (T("displacement here"), r"displacement here: expected a point as \(2, 0\) after the name"),
    ],
)  # fmt: skip
def test_an_unknown_quantity_is_rejected_with_the_known_ones(output, message, tmp_path):
    with pytest.raises(tawami.InputError, match=message):
        output.begin(tmp_path, static_scene(), None)


def test_a_point_away_from_the_body_is_rejected(tmp_path):
    with pytest.raises(
        tawami.InputError, match=r"no particle was within a cell \(0.25 m\) of it: exp"
    ):
        T("displacement (0.45, 1.7)").begin(tmp_path, plastic_block().scene, None)
