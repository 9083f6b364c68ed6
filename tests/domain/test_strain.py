"""Strain of the particles: the closed form of a homogeneous deformation, at small and finite strain."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI
from scenes import FINITE, FORMS
from scipy.linalg import logm

import tawami

GRADIENT = np.array([[2e-3, 5e-3], [1e-3, -3e-3]])


def tensor(components):
    """Components xx, yy, zz, xy of a tensor in the plane."""
    return [components[0, 0], components[1, 1], 0.0, components[0, 1]]


def held(form, basis="quadratic_spline", **options):
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0.0, 0.0), h=0.5, cells=(4, 2))
    body = tawami.box(grid, (0.0, 0.0), (2.0, 1.0), per_axis=3, gauss=True)
    return tawami.Scene(
        grid, body, tawami.linear_elastic(E=1e3, nu=0.3), basis=basis, **form, **options
    )


@pytest.mark.parametrize("name", ["u", "u_epsv", "u_bbar", "u_p"])
def test_small_strain_is_the_symmetric_gradient_of_the_displacement(name):
    basis = "bilinear" if name == "u_bbar" else "quadratic_spline"
    scene = held(FORMS[name], basis, tolerance=1e-12)
    for edge in ("left", "right", "bottom", "top"):
        for component, (a, b) in zip("xy", GRADIENT, strict=True):
            scene.fix(edge, component, lambda x, y, a=a, b=b: a * x + b * y)
    expected = tensor((GRADIENT + GRADIENT.T) / 2)
    tawami.ramp(scene, 0.25)
    assert np.abs(np.asarray(scene.particles.strain) - expected).max() < 1e-12
    solution = scene.solve()
    assert np.abs(solution.strain - expected).max() < 1e-12
    with pytest.raises(ValueError, match="read-only"):
        scene.particles.strain[:] = 0.0
    with pytest.raises(
        tawami.InputError, match="particles store it at finite strain only: .*strain"
    ):
        scene.particles.displacement_gradient  # noqa: B018


@pytest.mark.parametrize("name", FINITE)
def test_finite_strain_is_logarithmic_and_survives_resets_of_the_grid(name):
    """A cloud without stiffness that flies apart: v = A x, F = I + A t."""
    a = np.array([[0.5, 0.9], [-0.3, 0.2]])
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(-1.5, -1.5), h=0.25, cells=(12, 12))
    body = tawami.box(grid, (-0.5, -0.5), (0.5, 0.5), per_axis=3)
    jelly = tawami.linear_elastic(E=1e-9, nu=0.3)
    scene = tawami.Scene(grid, body, jelly, density=1.0, **FINITE[name])
    motion = tawami.Dynamics(scene, velocity=np.asarray(body.x) @ a.T, transfer="tpic")
    motion.velocity_gradient[:] = a
    cells = scene.particles_per_cell
    for _ in range(8):
        solution = motion.step(0.1)
    f = np.eye(2) + 0.8 * a
    np.testing.assert_allclose(scene.particles.x, body.x @ f.T, atol=1e-6)
    assert (scene.particles_per_cell != cells).any()
    gradient = np.asarray(scene.particles.displacement_gradient)
    np.testing.assert_allclose(gradient, np.broadcast_to(f - np.eye(2), gradient.shape), atol=1e-6)
    expected = tensor(logm(f @ f.T).real / 2)
    np.testing.assert_allclose(
        scene.particles.strain, np.tile(expected, (len(body.x), 1)), atol=1e-6
    )
    assert np.array_equal(solution.strain, scene.particles.strain)


def test_a_small_deformation_keeps_its_digits_at_finite_strain():
    scene = held({"form": "u_finite"}, tolerance=1e-4)
    for edge in ("left", "right", "bottom", "top"):
        for component, (a, b) in zip("xy", 1e-9 * GRADIENT, strict=True):
            scene.fix(edge, component, lambda x, y, a=a, b=b: a * x + b * y)
    expected = np.array(tensor((GRADIENT + GRADIENT.T) / 2)) * 1e-9
    assert np.abs(scene.solve().strain - expected).max() < 1e-5 * np.abs(expected).max()
