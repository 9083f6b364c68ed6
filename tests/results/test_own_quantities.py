"""Quantities of the driver script in outputs: written as others are, and errors that name them."""

from __future__ import annotations

import meshio
import numpy as np
import pytest
from readers import pvd
from runs import plastic_block, static_scene

import tawami

P, G, T, Q = tawami.ParticleOutput, tawami.GridOutput, tawami.TableOutput, tawami.Quantity


def largest_shear(p):
    return np.hypot(0.5 * (p.stress[:, 0] - p["stress"][:, 1]), p.stress[:, 3])


SHEAR = Q("largest shear stress [Pa]", largest_shear)
RATIO = Q("ratio [-]", lambda p: p.mean_stress / max(np.abs(p["mean stress"]).max(), 1e-9))


def test_a_quantity_of_the_driver_script_is_written_as_others_are(tmp_path):
    scene = static_scene()
    results = tawami.Results(tmp_path, P("stress", SHEAR, RATIO), G(SHEAR, RATIO, "mean stress"))
    tawami.ramp(scene, 0.5, results=results)
    particles, grid = (
        meshio.read(pvd(tmp_path / "ramp" / f"{name}.pvd")[-1][1]).point_data
        for name in ("particles", "grid")
    )
    stress = np.asarray(scene.particles.stress)
    mean = stress[:, :3].mean(axis=1)
    shear = np.hypot(0.5 * (stress[:, 0] - stress[:, 1]), stress[:, 3])
    np.testing.assert_allclose(particles["largest shear stress [Pa]"], shear)
    np.testing.assert_allclose(particles["ratio [-]"], mean / np.abs(mean).max())
    scaled = grid["ratio [-]"] * np.abs(mean).max()
    np.testing.assert_allclose(scaled, grid["mean stress [Pa]"], rtol=1e-12)
    (picture, *_) = tawami.plot(tmp_path, quantity="ratio", movie=None)
    assert picture.name == "ramp-ratio.png"


def test_quantities_of_motions_and_laws_can_be_used(tmp_path):
    motion = plastic_block()
    speed = Q("speed [m/s]", lambda p: np.linalg.norm(p.velocity, axis=1))
    flow = Q("flow [-]", lambda p: p.plastic_strain * p.volume / p.strain.shape[1])
    output = P(speed, flow)
    output.begin(tmp_path, motion, None)


@pytest.mark.parametrize(
    ("of", "message"),
    [
        (lambda p: p.stress, None),
        (lambda p: p.stress.T, r"an array of shape \(4, 128\): expected \(128,\) or \(128, compon"),
        (lambda p: 1.0, r"an array of shape \(\): expected"),
        (
            lambda p: np.log(p.stress[:, 0]),
            r"returned -inf for particle 0 and NaN or inf.* for 128 of",
        ),
        (lambda p: 1 / 0, "its function raised ZeroDivisionError: division by zero"),
        (lambda p: p.strss, r"'strss' is unknown: expected one of x, displacement, stress"),
        (lambda p: p.plastic_strain, r"the laws of this scene have no history: .*von_mises"),
        (lambda p: p.velocity, r"velocity: a scene by itself is static"),
        (lambda: 1.0, "its function raised TypeError: .* takes 0 positional arguments"),
    ],
)
@pytest.mark.parametrize("kind", [P, G])
@pytest.mark.filterwarnings("ignore:divide by zero:RuntimeWarning")
def test_a_function_that_fails_is_named(kind, of, message, tmp_path):
    output = kind(Q("my measure [Pa]", of))
    if message is None:
        output.begin(tmp_path, static_scene(), None)
        return
    with pytest.raises(tawami.InputError, match=rf"quantity 'my measure \[Pa\]': .*{message}"):
        output.begin(tmp_path, static_scene(), None)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (
            lambda: Q("shear", largest_shear),
            r"Quantity\('shear', ...\): expected a name with its unit",
        ),
        (lambda: Q("shear [Pa]", 3.0), r"Quantity\('shear \[Pa\]', 3.0\): expected a function"),
        (
            lambda: P(largest_shear),
            r"ParticleOutput.*expected names of quantities or tawami.Quantity",
        ),
        (lambda: T(SHEAR), "TableOutput.*expected names of quantities$"),
    ],
)
def test_what_is_not_a_quantity_is_rejected(make, message):
    with pytest.raises(tawami.InputError, match=message):
        make()


def test_labels_are_unique_and_only_nodal_quantities_are_projected(tmp_path):
    with pytest.raises(tawami.InputError, match=r"two quantities are called 'mean stress \[Pa\]'"):
        P("mean stress", Q("mean stress [Pa]", largest_shear)).begin(tmp_path, static_scene(), None)
    with pytest.raises(tawami.InputError, match=r"'a \[m\]' has nodal=False: .* or ParticleOutput"):
        G(Q("a [m]", lambda p: p.displacement, nodal=False)).begin(tmp_path, static_scene(), None)
