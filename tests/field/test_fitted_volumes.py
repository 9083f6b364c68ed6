"""Fitted volumes: a uniform pressure on the border balances a uniform stress in the body."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

import tawami
from cases.verification.cantilever import mpm
from cases.verification.cantilever.beam import V_THEORY, L
from tawami.field import full_cells

LAW = tawami.neo_hookean(E=1e3, nu=0.3)
LINEAR = tawami.linear_elastic(E=1e3, nu=0.3)


def moved(geometry="plane_strain", x0=0.0, **options):
    """A disc with a uniform pressure in it and around it, somewhere on the grid."""
    grid = tawami.Grid(
        MPI.COMM_WORLD, origin=(x0, -1.0), h=0.125, cells=(16, 16), geometry=geometry
    )
    disc = tawami.disc(grid, (x0 + 1.03, 0.02), 0.8)
    scene = tawami.Scene(grid, disc, LAW, form="u_finite", **options)
    scene.initial("stress", (-3.0, -3.0, -3.0, 0.0))
    scene.traction(
        "outer", (lambda x, y: -3 * (x - x0 - 1.03) / 0.8, lambda x, y: -3 * (y - 0.02) / 0.8)
    )
    return scene


@pytest.mark.parametrize(("geometry", "x0"), [("plane_strain", -1.0), ("axisymmetric", 0.5)])
def test_a_uniform_stress_balances_a_uniform_pressure(geometry, x0):
    unbalanced = {}
    for volumes in ("own", "fitted"):
        scene = moved(geometry, x0, volumes=volumes)
        external = scene.configuration.external()
        n = len(external)
        forces = scene.residual(np.zeros(scene.num_coefficients))[:n]
        assert np.linalg.norm(external) > 1
        unbalanced[volumes] = np.linalg.norm(forces - external)
    assert unbalanced["fitted"] < 0.5 * unbalanced["own"]


def test_volumes_and_masses_of_the_particles_stay():
    scenes = [moved(volumes=volumes, density=2e3) for volumes in ("own", "fitted")]
    np.testing.assert_array_equal(*(scene.particles.volume for scene in scenes))
    np.testing.assert_array_equal(*(scene.mass for scene in scenes))


def test_volumes_are_those_of_the_particles_where_these_move():
    residuals = {}
    for name, options in {"default": {}, "fitted": {"volumes": "fitted"},
                          "own": {"volumes": "own"}}.items():  # fmt: skip
        scene = moved(**options)
        residuals[name] = scene.residual(np.zeros(scene.num_coefficients))
    np.testing.assert_array_equal(residuals["default"], residuals["own"])
    assert np.abs(residuals["default"] - residuals["fitted"]).max() > 1e-3


def test_full_cells_are_integrated_exactly_where_particles_stay():
    # evenly spaced points with the weights 3/8, 1/4, 3/8 are exact to degree 3
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0.0, 0.0), h=0.5, cells=(2, 2))
    body = tawami.box(grid, (0.0, 0.0), (1.0, 1.0))
    location = grid.rust.locate(body.x)
    factors = full_cells.factors(grid, location, body.volume, np.zeros(36, dtype=np.uint32))
    along = 3 * np.where(np.abs(2 * body.x % 1 - 0.5) < 0.1, 1 / 4, 3 / 8)
    np.testing.assert_allclose(factors, along.prod(axis=1), rtol=1e-12)
    for power in range(4):
        integral = factors * body.volume @ (body.x[:, 0] ** power * body.x[:, 1])
        assert integral == pytest.approx(1 / (2 * (power + 1)), rel=1e-12)
    overlapping = full_cells.factors(grid, location, 2 * body.volume, np.zeros(36, dtype=np.uint32))
    np.testing.assert_array_equal(overlapping, 1)


def test_full_cells_are_as_good_as_gauss_points_at_small_strain():
    ways = {"own": {"volumes": "own"}, "full cells": {}, "Gauss": {"gauss": True}}
    off = {
        way: abs(
            mpm.build("u_epsv", "exact", 4, per_axis=3, **options).solve().displacement((L, 0))[1]
            + V_THEORY
        )
        for way, options in ways.items()
    }
    assert off["full cells"] == pytest.approx(off["Gauss"], rel=0.01)
    assert off["own"] > 2 * off["Gauss"]


@pytest.mark.parametrize("volumes", ["full_cells", "fitted"])
def test_energies_have_the_volumes_of_the_integrals(volumes):
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0.0, 0.0), h=0.5, cells=(4, 2))
    body = tawami.box(grid, (0.0, 0.0), (2.0, 1.0))
    scene = tawami.Scene(grid, body, LINEAR, form="u", density=1.0, volumes=volumes)
    scene.fix("left", "x")
    scene.fix("left", "y")
    motion = tawami.Dynamics(scene, velocity=lambda x, y: (0 * x, 1e-3 * x**2))
    motion.run(0.1, 0.02)
    assert motion.elastic_energy > 0.01 * motion.kinetic_energy
    assert abs(motion.energies.integration) < 1e-12 * motion.kinetic_energy


def test_bodies_without_a_border_are_rejected():
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0.0, 0.0), h=0.5, cells=(2, 2))
    loose = tawami.Body(np.array([[0.4, 0.4]]), np.array([0.1]))
    with pytest.raises(tawami.InputError, match="has no border: expected volumes='full_cells', or"):
        tawami.Scene(grid, loose, LAW, form="u_finite", volumes="fitted")
    tawami.Scene(grid, loose, LAW, form="u_finite", volumes="own")
    with pytest.raises(tawami.InputError, match="volumes = 'exact': expected"):
        tawami.Scene(grid, loose, LAW, form="u_finite", volumes="exact")
