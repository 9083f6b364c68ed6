"""Free vibrations compared with finite elements, and their properties."""

from functools import cache, partial

import numpy as np
import pytest
from mpi4py import MPI

import tawami
from cases.verification.vibrating_beam import fem
from cases.verification.vibrating_beam.beam import RHO, E
from tawami.motion import modes as module

LENGTH = 4.0  # of a clamped beam of depth 1 [m]


def beam(nu, n, *, clamped=True, density=RHO, **options):
    h = 1 / n
    grid = tawami.Grid(MPI.COMM_SELF, origin=(0, -0.5 - h), h=h, cells=(round(LENGTH) * n, n + 2))
    body = tawami.box(grid, (0, -0.5), (LENGTH, 0.5), gauss=True)
    scene = tawami.Scene(grid, body, tawami.linear_elastic(E=E, nu=nu), density=density, **options)
    if clamped:
        scene.fix("left", "x")
        scene.fix("left", "y")
    return scene


@cache
def by_finite_elements(nu):
    return fem.solve(nu, n=8, number=6, length=LENGTH).omega / (2 * np.pi)


@pytest.mark.parametrize(
    ("form", "nu", "first", "all_six"),
    [
        ("u", 0.3, 2e-3, 0.02),
        ("u_epsv", 0.3, 2e-3, 0.02),
        ("u_epsv_finite", 0.3, 2e-3, 0.02),
        ("u_epsv", 0.4999, 0.012, 0.025),
        ("u_p", 0.4999, 0.012, 0.025),
    ],
)
def test_a_clamped_beam_vibrates_as_finite_elements_say(form, nu, first, all_six):
    found = tawami.modes(beam(nu, 8, form=form), 6).frequencies
    errors = np.abs(found / by_finite_elements(nu) - 1)
    print(f"{form}, nu = {nu}: {found.round(5)} Hz, errors {errors.round(5)}")
    assert errors[0] < first
    assert errors.max() < all_six


def test_errors_decrease_with_the_square_of_the_cell():
    exact = by_finite_elements(0.3)[:3]
    coarse, fine = (tawami.modes(beam(0.3, n), 3).frequencies / exact - 1 for n in (4, 8))
    assert (np.abs(coarse / fine) > 3).all()


def test_a_free_body_has_three_rigid_motions():
    found = tawami.modes(beam(0.3, 4, clamped=False), 5)
    assert (found.frequencies[:3] == 0).all()
    assert found.frequencies[3] > 1.0


def test_shapes_have_unit_mass_and_are_orthogonal():
    """In the lumped mass of the grid, which differs from that of the particles by O(h^2)."""

    def defect(n):
        scene = beam(0.3, n)
        shapes = tawami.modes(scene, 4).shapes
        assert shapes.shape == (4, len(scene.particles), 2)
        mass = RHO * np.array(scene.particles.volume)
        return np.abs(np.einsum("ipd,jpd,p->ij", shapes, shapes, mass) - np.eye(4)).max()

    coarse, fine = defect(4), defect(8)
    assert fine < 0.03
    assert coarse / fine > 3.3


def test_axial_stress_changes_the_frequency_as_in_timoshenkos_beam():
    """Pinned ends: f^2 is proportional to 1 + N/N_cr; N_cr by Timoshenko and Gere 1961, section 2.17.

    The beam has the stress from the start, so that its length and thickness do not change with it.
    """
    nu, stress = 0.3, 3e-3 * E

    def square(traction):
        scene = beam(nu, 8, clamped=False, form="u_epsv_finite")
        scene.fix("left", "y")
        scene.fix("right", "y")
        scene.hold((LENGTH / 2, 0.0), "x")
        scene.initial("stress", (traction, 0.0, nu * traction, 0.0))
        scene.traction("left", (-traction, 0.0))
        scene.traction("right", (traction, 0.0))
        scene.solve()
        return tawami.modes(scene, 1).frequencies[0] ** 2

    euler = np.pi**2 * E / (1 - nu**2) / 12 / LENGTH**2
    critical = euler / (1 + euler / (5 / 6 * E / (2 * (1 + nu))))
    change = (square(stress) - square(-stress)) / (2 * square(0.0))
    print(f"change of the square {change:.4f}, N/N_cr {stress / critical:.4f}")
    assert change == pytest.approx(stress / critical, rel=0.08)  # the law's own change is 5 %


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: tawami.modes(3), "^modes: scene = 3: expected a tawami.Scene"),
        (lambda: tawami.modes(beam(0.3, 2), 0), "^modes: number = 0: expected"),
        (lambda: tawami.modes(beam(0.3, 2), 10**6), "expected at most [0-9]+ for this scene"),
        (lambda: tawami.modes(beam(0.3, 2, density=None)), r"mass needs Scene\(..., density="),
    ],
)
def test_wrong_arguments_are_named(make, message):
    with pytest.raises(tawami.InputError, match=message):
        make()


def test_vibrations_that_are_not_found_raise_an_error(monkeypatch):
    scene = beam(0.3, 4)
    monkeypatch.setattr(module, "eigsh", partial(module.eigsh, ncv=41, maxiter=1, tol=1e-300))
    with pytest.raises(tawami.ConvergenceError, match="of 40 vibrations were found. Request fewer"):
        tawami.modes(scene, 40)
    monkeypatch.undo()
    assert len(tawami.modes(scene, 4).frequencies) == 4


def test_walls_are_rejected():
    scene = beam(0.3, 2)
    scene.wall("right")
    with pytest.raises(tawami.InputError, match="^modes: the scene has walls"):
        tawami.modes(scene)


def test_a_sphere_breathes_with_lambs_frequency():
    """tan x = x / (1 - (x c_l / 2 c_t)^2), f = x c_l / (2 pi R) (Lamb 1882), nu = 0.25: x = 2.5634."""
    grid = tawami.Grid(
        MPI.COMM_WORLD, origin=(0, -1.125), h=0.125, cells=(9, 18), geometry="axisymmetric"
    )
    law = tawami.linear_elastic(E=1.0, nu=0.25)
    scene = tawami.Scene(
        grid, tawami.disc(grid, (0, 0), 1.0, gauss=True), law, form="u_finite", density=1.0,
        ghost_penalty="on",
    )  # fmt: skip
    found = tawami.modes(scene, 5).frequencies
    speed = np.sqrt(law.bulk_modulus + 4 / 3 * law.shear_modulus)
    assert found[0] == pytest.approx(0.0, abs=1e-6)  # the translation along the axis, no other
    assert found[1] > 0.2
    assert found[4] == pytest.approx(2.5634 * speed / (2 * np.pi), rel=0.01)
