"""The tangent equals a sum over particles that shares no code with it, to round-off."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from particle_sums import Sum
from profiles import examples
from scenes import BASES, FORMS, clouds

import tawami


def compare(scene: tawami.Scene, options: dict[str, object]) -> None:
    """Compare the tangent with the sum."""
    mine = scene.tangent(np.zeros(scene.num_coefficients)).toarray()
    reference = Sum(scene, options).matrix()
    assert mine.shape == reference.shape
    assert np.abs(mine - reference).max() < 1e-12 * np.abs(reference).max()


@pytest.mark.parametrize("assembly", ["dolfinx", "points"])
def test_the_tangent_of_random_particles_of_two_materials(random_scene, form, basis, assembly):
    compare(random_scene(basis=basis, assembly=assembly, **form), form)


@pytest.mark.parametrize("name", FORMS)
def test_the_tangent_of_single_particles_in_their_cells(random_scene, name):
    x = np.array([[-0.9, 0.6], [-0.9, 1.9], [0.95, 1.27], [0.1, 0.77], [0.2, 0.83]])
    compare(random_scene(x=x, **FORMS[name]), FORMS[name])


@pytest.mark.parametrize("name", ["u_epsv", "u_bbar", "u_epsv_projection"])
def test_the_tangent_of_particles_on_edges_and_corners_of_cells(random_scene, name):
    x = np.array([[-1, 0.5], [1, 2], [-0.5, 1], [0, 1.2], [-0.3, 1.5], [1, 0.5], [0.25, 2.0]])
    compare(random_scene(x=x, **FORMS[name]), FORMS[name])


@settings(max_examples=examples(15))
@given(data=st.data())
def test_the_tangent_of_any_cloud_of_particles(data):
    grid, x = data.draw(clouds(cells=(4, 3), most=12))
    basis = data.draw(st.sampled_from(BASES))
    laws = [tawami.linear_elastic(E=2.0, nu=0.3), tawami.linear_elastic(E=7.0, nu=0.49)]
    numbers = data.draw(st.lists(st.integers(0, 1), min_size=len(x), max_size=len(x)))
    volumes = np.linspace(0.01, 0.2, len(x))
    body = tawami.Body(x, volumes)
    for assembly in ("dolfinx", "points"):
        scene = tawami.Scene(
            grid, body, laws, material_of=numbers, basis=basis, alpha=0.3, assembly=assembly,
            ghost_penalty="off",
        )  # fmt: skip
        compare(scene, {"form": "u_epsv", "alpha": 0.3})
