"""Projection of particle fields to the vertices of the grid."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scenes import clouds, grid_of

import tawami
from cases.costs import projection as case
from tawami.results.projection import nodal, vertices

METHODS = ("lumped", "consistent")


def scene_of(grid, x, volume=None):
    body = tawami.Body(np.asarray(x), np.ones(len(x)) if volume is None else volume)
    return tawami.Scene(grid, body, tawami.linear_elastic(E=1.0, nu=0.3), form="u")


@given(cloud=clouds((4, 3), 30), seed=st.integers(0, 9))
def test_constants_are_exact_and_means_stay_in_range(cloud, seed):
    grid, x = cloud
    random = np.random.default_rng(seed)
    scene = scene_of(grid, x, random.uniform(0.1, 1.0, len(x)))
    # a vertex has a value where a particle is closer than a cell along both axes
    distance = np.abs(vertices(scene)[:, None] - x[None]).max(axis=2) / grid.h
    near, far = (distance < 1 - 1e-6).any(axis=1), (distance > 1 + 1e-6).all(axis=1)
    values = random.standard_normal((len(x), 2))
    for method in METHODS:
        constant = nodal(scene, np.full(len(x), -3.7), method)
        np.testing.assert_allclose(constant[near], -3.7, rtol=1e-9)
        assert np.isnan(constant[far]).all()
    found = nodal(scene, values)
    for vertex in np.flatnonzero(near):
        around = values[distance[vertex] < 1 + 1e-6]
        assert (found[vertex] >= around.min(axis=0) - 1e-12).all()
        assert (found[vertex] <= around.max(axis=0) + 1e-12).all()


@given(seed=st.integers(0, 99), method=st.sampled_from(METHODS))
def test_the_volume_integral_is_conserved(seed, method):
    """sum_i (sum_p V_p M_i) f_i = sum_p V_p f_p, the functions M_i summing to 1."""
    random, grid = np.random.default_rng(seed), grid_of()
    x = grid.origin + grid.h * np.array(grid.cells) * random.random((25, 2))
    scene = scene_of(grid, x, random.uniform(0.1, 1.0, 25))
    values = random.standard_normal(25)
    weight = scene.configuration.domain.sums(scene.particles.volume, np.ones((25, 1)), "bilinear")[
        :, 0
    ]
    total = np.nansum(weight * nodal(scene, values, method))
    if method == "consistent":  # of the projected field at the particles
        assert total == pytest.approx(scene.particles.volume @ values, abs=1e-6)
    else:
        assert total == pytest.approx(weight[weight > 0] @ nodal(scene, values)[weight > 0])
        assert total == pytest.approx(scene.particles.volume @ values, abs=1e-12)


def test_bilinear_fields_are_exact():
    grid = grid_of((5, 4))
    lattice = tawami.box(grid, (-1.0, 0.5), (1.0, 2.0), per_axis=2)
    for body in (lattice, tawami.Body(lattice.x + 0.1, lattice.volume)):
        scene = tawami.Scene(grid, body, tawami.linear_elastic(E=1.0, nu=0.3))

        def field(x):
            return 2.0 - 3.0 * x[:, 0] + 0.5 * x[:, 1] + 7.0 * x[:, 0] * x[:, 1]

        found = nodal(scene, field(body.x), "consistent")
        near = np.isfinite(found)
        assert near.sum() >= 5 * 4
        np.testing.assert_allclose(found[near], field(vertices(scene))[near], atol=1e-7)
        assert np.abs(nodal(scene, field(body.x)) - field(vertices(scene)))[near].max() > 0.5


def test_single_particles_keep_their_value():
    """Without slopes in the data the consistent projection equals the lumped one."""
    grid = grid_of((5, 4))
    x = np.array([[-0.9, 0.6], [0.8, 2.1]])
    found = nodal(scene_of(grid, x), np.array([4.0, -2.0]), "consistent")
    assert sorted(found[np.isfinite(found)]) == pytest.approx([-2.0] * 4 + [4.0] * 4)


def test_the_consistent_projection_is_more_accurate_in_bending(capsys):
    """It equals its direct solution, converges, and its matrix is well conditioned."""
    case.main([])
    lines = [line.split() for line in capsys.readouterr().out.splitlines()[1:]]
    found = {tuple(line[:3]): line[3:] for line in lines}
    for particles in ("lattice", "moved", "random"):
        for n in ("4", "8", "16"):
            lumped, own, direct = (
                np.array(found[particles, n, method][:4], dtype=float)
                for method in ("lumped", "consistent", "direct")
            )
            np.testing.assert_allclose(own, direct, atol=1e-7)
            assert (own < 0.5 * lumped).all()
            assert float(found[particles, n, "direct"][4]) < 200
        assert float(found[particles, "16", "lumped"][0]) < 0.02
        assert float(found[particles, "16", "consistent"][2]) < 0.006


def test_an_unknown_method_is_rejected():
    grid = grid_of()
    with pytest.raises(tawami.InputError, match="projection = 'spr': expected 'lumped' or 'c"):
        nodal(scene_of(grid, [[0.0, 1.0]]), np.ones(1), "spr")
