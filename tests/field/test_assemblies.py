"""The assembly at the particles agrees with dolfinx and P^T K P; its bits do not depend on the
number of threads.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from profiles import examples
from programs import python
from scenes import BASES, FORMS, clouds, grid_of
from scipy.sparse import csr_matrix, identity

import tawami
from tawami import _rust
from tawami.field.matrix import as_arrays
from tawami.form import vector
from tawami.form.form import Form

SUPPORTS = {
    "edges": lambda s: (s.fix("left", "x"), s.fix("left", "y", lambda x, y: 1e-3 * y)),
    "points": lambda s: (
        s.hold((-1, 0.7), "x"),
        s.hold((-0.9, 1.9), "x"),
        s.hold((0.3, 1.1), "y", 1),
    ),
    "both": lambda s: (s.fix("bottom", "y"), s.hold((-0.51, 1.2), "x"), s.hold((-0.5, 1.3), "y")),
}


def both(make):
    """The same scene with both assemblies."""
    return [make(assembly=path) for path in ("points", "dolfinx")]


def close(a, b):
    assert np.abs(a - b).max() < 1e-12 * max(np.abs(b).max(), 1e-300)


def reduced(scene, c):
    """P^T K P at increments c, as the solver gets it."""
    reduction = scene.reduction()
    scene.configuration.domain.newton.internal(c)
    field, data = scene.configuration.domain.assembly, scene.configuration.domain.responses.data
    start, columns, values = field.tangent(c, data, reduction).getValuesCSR()
    return csr_matrix((values, columns, start), shape=(reduction.size,) * 2).toarray()


@pytest.mark.parametrize("support", SUPPORTS)
def test_residual_and_reduced_tangent_agree(random_scene, form, basis, support):
    scenes = both(lambda **path: random_scene(basis=basis, count=150, **form, **path))
    for scene in scenes:
        SUPPORTS[support](scene)
    c = np.random.default_rng(0).standard_normal(scenes[0].num_coefficients)
    close(*[scene.residual(c) for scene in scenes])
    close(*[reduced(scene, c) for scene in scenes])
    close(*[scene.tangent(c).toarray() for scene in scenes])


def test_a_form_nonlinear_in_the_fields_agrees(random_scene):
    """Fields as coefficients of the tangent, two rules, cell means, a constant of the form."""
    from ufl import div, dot, grad

    def residual(u, w, s, sigma_m, K, cell_mean, sum_p, sum_c, dx, dx_c, beta):
        extra = beta * cell_mean(K) * div(u) ** 2 * dot(u, w)
        return sum_p(s, grad(w)) + sum_c(sigma_m, div(w)) + extra * dx + 2 * extra * dx_c

    form = Form(
        {"u": vector("w")}, residual, kinematics="cell", parameters={"beta": {"default": 0.7}}
    )
    scenes = both(lambda **path: random_scene(form=form, **path))
    for scene in scenes:
        SUPPORTS["both"](scene)
    c = np.random.default_rng(1).standard_normal(scenes[0].num_coefficients)
    close(*[scene.residual(c) for scene in scenes])
    close(*[reduced(scene, c) for scene in scenes])


@settings(max_examples=examples(20))
@given(data=st.data())
def test_any_cloud_of_particles_agrees(data):
    grid, x = data.draw(clouds(cells=(7, 7), most=20))
    options = FORMS[data.draw(st.sampled_from(sorted(FORMS)))]
    basis = data.draw(st.sampled_from(BASES))
    body = tawami.Body(x, np.full(len(x), 0.1))
    material = tawami.linear_elastic(E=2.0, nu=0.3)
    scenes = both(lambda **p: tawami.Scene(grid, body, material, basis=basis, **options, **p))
    c = np.random.default_rng(0).standard_normal(scenes[0].num_coefficients)
    close(*[scene.residual(c) for scene in scenes])
    close(*[scene.tangent(c).toarray() for scene in scenes])


@pytest.mark.parametrize("support", ["paper", "exact", "clamped"])
def test_the_deflections_of_the_beam_agree(support):
    from cases.verification.cantilever import mpm

    rows = [mpm.solve("u_epsv", support, 8, 0.1, assembly=p)[0] for p in ("points", "dolfinx")]
    assert rows[0].deflection_m == pytest.approx(rows[1].deflection_m, rel=1e-12)
    assert rows[0].unknowns == rows[1].unknowns


def test_newton_reuses_the_pattern(random_scene):
    """Several iterations on one pattern: each tangent agrees."""
    from ufl import div, grad

    def stiff(u, w, sigma, mu, cell_mean, sum_p, dx):
        stiffer = 3e3 * cell_mean(mu) * div(u) ** 3 * div(w) * dx
        return sum_p(sigma, grad(w)) + stiffer

    form = Form({"u": vector("w")}, stiff)
    solutions = []
    for path in ("points", "dolfinx"):
        grid = grid_of()
        body = tawami.box(grid, grid.origin, grid.upper, per_axis=3)
        material = tawami.linear_elastic(E=1e3, nu=0.2)
        scene = tawami.Scene(grid, body, material, form=form, tolerance=1e-12, assembly=path)
        scene.fix("left", "x")
        scene.fix("left", "y")
        scene.traction("right", (120.0, 20.0))
        solutions.append(scene.solve())
    assert solutions[0].iterations == solutions[1].iterations > 3
    close(solutions[0].u, solutions[1].u)


def test_bits_do_not_depend_on_the_number_of_threads():
    """Residual, tangent, a reduced tangent with points held in every row of cells, steps of a motion."""
    code = """
import hashlib, logging; logging.disable(logging.INFO)
import numpy as np
import tawami
from mpi4py import MPI
total = hashlib.sha256()
for basis in ("quadratic_spline", "bilinear", "biquadratic"):
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=0.1, cells=(12, 40))
    body = tawami.box(grid, grid.origin, grid.upper, per_axis=3)
    scene = tawami.Scene(grid, body, tawami.linear_elastic(E=1.0, nu=0.49), basis=basis)
    for row in range(40):
        scene.hold((0.13 + 0.02 * (row % 5), 0.1 * row + 0.04), "x")
        scene.hold((0.71, 0.1 * row + 0.06), "y")
    c = np.random.default_rng(0).standard_normal(scene.num_coefficients)
    total.update(scene.residual(c).tobytes() + scene.tangent(c).data.tobytes())
    domain, reduction = scene.configuration.domain, scene.reduction()
    for _ in range(3):
        matrix = domain.assembly.tangent(c, domain.responses.data, reduction)
        total.update(matrix.getValuesCSR()[2].tobytes())
grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=0.1, cells=(12, 8))
sand = tawami.drucker_prager(tawami.linear_elastic(E=1e5, nu=0.3), phi=30.0, c=10.0)
for form in ("u_epsv_finite", "u_bbar_finite"):
    body = tawami.box(grid, (0, 0), (0.6, 0.5))
    scene = tawami.Scene(grid, body, sand, form=form, density=1000.0)
    scene.gravity((0.0, -9.81))
    scene.fix("left", "x")
    scene.fix("bottom", "y")
    motion = tawami.Dynamics(scene)
    for _ in range(3):
        motion.step(0.01)
    total.update(scene.particles.rows().tobytes())
print(total.hexdigest())
"""
    found = set()
    for threads in ("1", "2", "7"):
        run = python("-c", code, variables={"RAYON_NUM_THREADS": threads}, check=True)
        found.add(run.stdout.splitlines()[-1])  # MPI may print lines before
    assert len(found) == 1


def test_one_field_serves_several_reductions_in_turn(random_scene):
    """A second pattern, the first again, and values that the solver scaled between them."""
    scenes = both(lambda **path: random_scene(count=150, **path))
    c = np.random.default_rng(0).standard_normal(scenes[0].num_coefficients)
    for scene in scenes:
        scene.fix("left", "x")
        scene.hold((-0.9, 1.9), "y")
    close(*[reduced(scene, c) for scene in scenes])
    reductions = [scene.reduction() for scene in scenes]
    for scene in scenes:
        scene.hold((0.4, 1.3), "y")
    close(*[reduced(scene, c) for scene in scenes])
    values = []
    for scene, reduction in zip(scenes, reductions, strict=True):
        matrix = scene.configuration.domain.assembly.tangent(
            c, scene.configuration.domain.responses.data, reduction
        )
        vector = matrix.createVecLeft()
        vector.set(3.0)
        matrix.diagonalScale(vector, vector)
        again = scene.configuration.domain.assembly.tangent(
            c, scene.configuration.domain.responses.data, reduction
        )
        values.append(again.getValuesCSR()[2].sum())
    assert values[0] == pytest.approx(values[1], rel=1e-9)


def test_the_solutions_after_a_change_of_supports_agree():
    def run(path):
        grid = grid_of()
        body = tawami.box(grid, grid.origin, grid.upper, per_axis=2)
        material = tawami.linear_elastic(E=1e3, nu=0.4999)
        scene = tawami.Scene(grid, body, material, assembly=path)
        scene.fix("left", "x")
        scene.hold((-1.0, 1.25), "y")
        scene.traction("right", (1.0, -2.0))
        scene.solve()
        scene.hold((1.0, 1.25), "y", -1e-3)
        return scene.solve()

    points, reference = run("points"), run("dolfinx")
    assert np.abs(points.u - reference.u).max() < 1e-10 * np.abs(reference.u).max()


def test_arrays_that_do_not_fit_raise_an_error(random_scene):
    scene = random_scene(form="u")
    assembly, c = scene.configuration.domain.assembly, np.zeros(scene.num_coefficients)
    scene.residual(c)
    field = assembly._kernels
    (kernels, none), volume = field._of_tangent, scene.particles.volume
    data = list(scene.configuration.domain.responses.data.values())
    with pytest.raises(RuntimeError, match="kernels of another rank"):
        field.assembler.vector(kernels, data, volume, c)
    owner, address, rank, width, *rest = field._kernel(assembly.attachment.compiled.tangent[0])
    pattern = field.assembler.pattern(as_arrays(identity(len(c), format="csr"), np.arange(len(c))))
    wrong = (owner, address, rank, width + 1, *rest)
    with pytest.raises(RuntimeError, match="a kernel of other coefficients"):
        _rust.Kernels(field.assembler, 2, [wrong])
    with pytest.raises(RuntimeError, match="a kernel of another rank"):
        _rust.Kernels(field.assembler, 1, [(owner, address, rank, width, *rest)])
    values = np.zeros(len(pattern.columns))
    with pytest.raises(RuntimeError, match="kernels of other data"):
        field.assembler.matrix(kernels, none, [], volume, c, pattern, values)
    short = [array[1:] for array in data]
    with pytest.raises(RuntimeError, match="data of other particles"):
        field.assembler.matrix(kernels, none, short, volume, c, pattern, values)
    with pytest.raises(RuntimeError, match="another pattern"):
        field.assembler.matrix(kernels, none, data, volume, c, pattern, np.zeros(3))
    more = random_scene(count=1, form="u").configuration.domain
    foreign = as_arrays(identity(len(c), format="csr"), np.arange(len(c)))
    fewer = more.assembly._kernels.assembler.pattern(foreign)
    with pytest.raises(RuntimeError, match="not the pattern of this matrix"):
        field.assembler.matrix(kernels, none, data, volume, c, fewer, np.zeros(len(fewer.columns)))
    with pytest.raises(RuntimeError, match="not a selection of these coefficients"):
        field.assembler.pattern(as_arrays(identity(3, format="csr"), np.arange(3)))


def test_an_unknown_assembly_is_rejected(random_scene):
    with pytest.raises(
        tawami.InputError, match="assembly = 'quick': expected 'points' or 'dolfinx'"
    ):
        random_scene(assembly="quick")
