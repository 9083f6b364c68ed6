"""Finite strain: derivatives, both assemblies, rigid rotation, closed forms, a heavy column."""

from __future__ import annotations

import numpy as np
import pytest
from scenes import BASES, FINITE, greville, grid_of, linear_field
from scipy.linalg import expm
from scipy.optimize import root

import tawami
from cases.verification import self_weight
from tawami.form import scalar, vector
from tawami.form.form import Form


@pytest.fixture(params=FINITE)
def finite(request):
    return FINITE[request.param]


@pytest.fixture(params=[tawami.linear_elastic, tawami.neo_hookean])
def law(request):
    return request.param


def pushed(random_scene, **options):
    """A scene with stress in it, and increments away from zero."""
    scene = random_scene(count=80, **options)
    random = np.random.default_rng(1)
    scene.particles.stress[:] = 0.3 * random.standard_normal(scene.particles.stress.shape)
    return scene, 0.02 * random.standard_normal(scene.num_coefficients)


@pytest.mark.parametrize("basis", BASES)
def test_the_tangent_is_the_difference_of_the_residual(random_scene, finite, basis, law):
    scene, c = pushed(random_scene, basis=basis, law=law, **finite)
    direction = np.random.default_rng(2).standard_normal(len(c))
    tangent = scene.tangent(c) @ direction
    h = 1e-6
    difference = (scene.residual(c + h * direction) - scene.residual(c - h * direction)) / (2 * h)
    assert np.abs(tangent - difference).max() < 1e-6 * np.abs(tangent).max()


@pytest.mark.parametrize("basis", BASES)
def test_both_assemblies_agree(random_scene, finite, basis):
    results = []
    for path in ("points", "dolfinx"):
        scene, c = pushed(random_scene, basis=basis, assembly=path, **finite)
        results.append((scene.residual(c), scene.tangent(c).toarray()))
    for a, b in zip(*results, strict=True):
        assert np.abs(a - b).max() < 1e-12 * np.abs(b).max()


def test_the_elastic_tangent_is_symmetric_without_stress(random_scene, finite, law):
    scene = random_scene(law=law, **finite)
    matrix = scene.tangent(np.zeros(scene.num_coefficients)).toarray()
    assert np.abs(matrix - matrix.T).max() < 1e-13 * np.abs(matrix).max()


@pytest.mark.parametrize("angle", [0.1, 1.0, 3.0])
def test_a_rotation_of_the_body_gives_no_force(random_scene, finite, angle, law):
    scene = random_scene(law=law, **finite)
    grid = scene.grid
    x, y = (grid.h * greville("quadratic_spline", n) for n in grid.cells)
    points = np.stack([np.tile(x, len(y)), np.repeat(y, len(x))], axis=1)
    s, co = np.sin(angle), np.cos(angle)
    u = points @ np.array([[co - 1, s], [-s, co - 1]])
    c = np.zeros(scene.num_coefficients)
    c[: u.size] = u.ravel()
    strained = np.zeros_like(c)
    strained[: u.size] = 0.1 * points.ravel()
    assert np.abs(scene.residual(c)).max() < 1e-12 * np.abs(scene.residual(strained)).max()


def test_small_increments_give_the_small_strain(random_scene, finite, law):
    small = finite["form"].removesuffix("_finite")
    consistent = {"theta": 0.0} if small == "u_epsv" else {}
    penalty = {"ghost_penalty": "off"} if small == "u_epsv" else {}  # on other sides
    scene = random_scene(law=law, **finite | penalty, **consistent)
    other = random_scene(**finite | penalty | {"form": small})
    c = 1e-8 * np.random.default_rng(0).standard_normal(scene.num_coefficients)
    a, b = scene.residual(c), other.residual(c)
    assert np.abs(a - b).max() < 1e-6 * np.abs(b).max()


def hencky_stress(K, mu, stretches):
    """Principal Kirchhoff stresses, independent of the package."""
    e = np.log(stretches)
    return 2 * mu * (e - e.mean()) + K * e.sum()


def neo_hookean_stress(K, mu, stretches):
    """Principal Kirchhoff stresses, independent of the package."""
    J = np.prod(stretches)
    b = J ** (-2 / 3) * np.square(stretches)
    return mu * (b - b.mean()) + K * np.log(J)


STRESSES = {tawami.linear_elastic: hencky_stress, tawami.neo_hookean: neo_hookean_stress}


def block(law, form):
    """2 m x 1 m, filling its grid, with particles at Gauss points."""
    grid = tawami.Grid(grid_of().comm, origin=(0, 0), h=0.5, cells=(4, 2))
    body = tawami.box(grid, (0, 0), (2, 1), per_axis=3, gauss=True)
    # quadratic B-bar misses the patch test (documentation, Limits)
    basis = "bilinear" if form["form"] == "u_bbar_finite" else "quadratic_spline"
    return tawami.Scene(grid, body, law, tolerance=1e-10, basis=basis, **form)


def check_step(scene, f):
    """Check that one step reaches the homogeneous f to 1e-8; the particles stay inside the grid."""
    step = scene.configuration.domain.newton.solve(
        scene.reduction(), scene.configuration.external()
    )
    fields = scene.split(step.coefficients)
    u = linear_field(scene.grid, scene.basis, np.zeros(2), f - np.eye(2))
    assert np.abs(fields[0] - u).max() < 1e-8
    scene.configuration.domain.stage.commit(*fields)


def move(scene, generator, steps=8):
    """Move all edges by exp(generator) in equal steps; the deformation gradient."""
    f = expm(np.array(generator) / steps)
    scene.configuration.supports.all.clear()
    for edge in ("left", "right", "bottom", "top"):
        for component, (a, b) in zip("xy", f - np.eye(2), strict=True):
            scene.fix(edge, component, lambda x, y, a=a, b=b: a * x + b * y)
    for _ in range(steps):
        check_step(scene, f)
    return np.linalg.matrix_power(f, steps)


@pytest.mark.parametrize("nu", [0.0, 0.3, 0.49])
@pytest.mark.parametrize("biaxial", [False, True])
def test_plane_tension_agrees_with_the_closed_form(finite, law, nu, biaxial):
    """In one step, with free or loaded sides: the nominal stress is P."""
    pull = np.array([0.25, 0.25 if biaxial else 0.0])
    made = law(E=1.0, nu=nu)

    def stress(stretches):
        return STRESSES[law](made.bulk_modulus, made.shear_modulus, np.array([*stretches, 1.0]))

    stretches = root(lambda a: stress(a)[:2] / a - pull, [1.1, 1.0], tol=1e-13).x
    scene = block(made, finite)
    scene.fix("left", "x")
    scene.fix("bottom", "y")
    scene.traction("right", (pull[0], 0.0))
    scene.traction("top", (0.0, pull[1]))
    check_step(scene, np.diag(stretches))
    assert np.abs(scene.particles.stress - [*stress(stretches), 0.0]).max() < 1e-8


def test_a_body_that_leaves_its_grid_changes_nothing(finite):
    scene = block(tawami.linear_elastic(E=1.0, nu=0.3), finite)
    scene.fix("left", "x")
    scene.fix("bottom", "y")
    scene.traction("right", (0.25, 0.0))
    with pytest.raises(tawami.InputError, match="would leave the grid"):
        scene.solve()
    assert not scene.particles.stress.any()


SHEAR = [[0.0, 0.4], [0.0, 0.0]]
TURN = [[0.0, -0.8], [0.8, 0.0]]
MOTIONS = {
    "shear": [SHEAR],
    "uniaxial": [np.diag([0.4, 0.0])],
    "equibiaxial": [np.diag([-0.3, -0.3])],
    "turned": [np.diag([0.3, -0.1]), TURN],
    "all": [SHEAR, TURN, np.diag([-0.2, 0.3]), np.transpose(SHEAR)],
}


@pytest.mark.parametrize("motion", MOTIONS)
def test_the_stress_after_many_steps_is_that_of_the_total_deformation(finite, law, motion):
    """Only the stress is carried from step to step: it gives the elastic strain."""
    K, mu = 5.0, 2.0
    scene = block(law(K=K, mu=mu), finite)
    F = np.eye(2)
    for generator in MOTIONS[motion]:
        F = move(scene, generator) @ F
    squares, directions = np.linalg.eigh(F @ F.T)
    *plane, zz = STRESSES[law](K, mu, np.sqrt([*squares, 1.0]))
    tau = directions * plane @ directions.T
    expected = [tau[0, 0], tau[1, 1], zz, tau[0, 1]]
    assert np.abs(scene.particles.stress - expected).max() < 1e-8


def test_simple_shear_of_a_neo_hookean_block_agrees_with_the_closed_form(finite):
    """be = F F^T: tau_xy = mu gamma, and the normal stress difference mu gamma^2."""
    gamma, mu = 0.8, 2.0
    scene = block(tawami.neo_hookean(K=1e3, mu=mu), finite)
    move(scene, [[0.0, gamma], [0.0, 0.0]])
    third = gamma**2 / 3
    expected = mu * np.array([2 * third, -third, -third, gamma])
    assert np.abs(scene.particles.stress - expected).max() < 1e-8


def test_a_neo_hookean_law_needs_a_form_of_finite_strain():
    grid = grid_of()
    body = tawami.box(grid, grid.origin, grid.upper, per_axis=2)
    law = tawami.neo_hookean(E=1.0, nu=0.3)
    for form in ("u_epsv", "u_p", "u"):
        with pytest.raises(
            tawami.InputError,
            match=r"particle 0 exists at finite strain only.*Use form 'u_epsv_finite' or 'u_finite'",
        ):
            tawami.Scene(grid, body, law, form=form)
    with pytest.raises(tawami.InputError, match=r"von_mises: elastic = .*: expected a material of"):
        tawami.von_mises(law, yield_stress=1.0)


def test_an_iterate_that_inverts_a_particle_is_rejected():
    grid = grid_of()
    body = tawami.box(grid, grid.origin, grid.upper, per_axis=2)
    scene = tawami.Scene(grid, body, tawami.linear_elastic(E=1.0, nu=0.3), form="u_finite")
    scene.fix("left", "x")
    scene.fix("left", "y")
    for y in (0.7, 1.2, 1.7):
        scene.hold((0.9, y), "x", -3.0)
    with pytest.raises(tawami.ConvergenceError, match="turns particle .* inside out"):
        scene.solve()
    assert not scene.particles.stress.any()


@pytest.mark.parametrize(
    ("form", "height", "stress"),
    [("u_finite", 3e-3, 0.025), ("u_epsv_finite", 3e-3, 0.025), ("u_bbar_finite", 6e-3, 0.025)],
)
def test_a_column_under_its_weight_agrees_with_the_closed_form(form, height, stress):
    """Across many cells; the closed form is an integral of Lambert's W."""
    assert self_weight.final_height() == pytest.approx(24.05965, abs=5e-6)
    result = self_weight.solve(form)
    assert abs(result.height_error) < height
    assert result.stress_error < stress
    assert max(result.iterations) <= 5


def test_unsupported_combinations_are_rejected(random_scene):
    with pytest.raises(
        tawami.FormError, match="strain = 'huge': expected one of 'small', 'finite'"
    ):
        Form({"u": vector("w")}, lambda w: w, strain="huge")
    fields = {"u": vector("w"), "p": scalar("q", role="pressure")}
    with pytest.raises(
        tawami.FormError, match="strain = 'finite' with a field of the role 'pressure'"
    ):
        Form(fields, lambda w: w, strain="finite")
    with pytest.raises(tawami.InputError, match=r"gravity\(...\) needs Scene\(..., density=...\)"):
        random_scene().gravity((0, -10))
    with pytest.raises(tawami.InputError, match="density = -1.0: expected a finite number"):
        random_scene(density=-1.0)
    with pytest.raises(
        tawami.InputError, match="density has 3 values: expected one, or one for each"
    ):
        random_scene(density=[1.0, 2.0, 3.0])
