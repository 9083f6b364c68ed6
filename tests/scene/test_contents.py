"""A scene has only the arrays, kernels, masses and imports that it needs; errors name the option that
adds more.
"""

from __future__ import annotations

import inspect
import subprocess
import sys

import pytest
from scenes import FINITE, FORMS, grid_of
from standing_block import STATIC, moving, plastic, scene_of

import tawami
from tawami.domain.domain import Domain
from tawami.domain.model import KEYWORDS
from tawami.fem import kernels
from tawami.form import compilation, vector
from tawami.solve.inertia import Inertia

MIXED = [name for name, options in (FORMS | FINITE).items() if "epsv" in options["form"]]


def views(particles, names):
    """The arrays of these names."""
    for name in names:
        if name in particles.history_names:
            yield particles.history(name)
        elif name in ("x", "eps_v", "strain", "displacement_gradient", *STATIC):
            yield getattr(particles, name)
        else:
            yield particles.carried(name)


# -- arrays --------------------------------------------------------------------


@pytest.mark.parametrize("name", FORMS | FINITE)
def test_a_static_elastic_scene_stores_only_the_arrays_of_its_form(name):
    scene = scene_of(**(FORMS | FINITE)[name])
    for _ in range(2):
        expected = STATIC + ["eps_v"] * (name in MIXED)
        expected += ["displacement_gradient" if name in FINITE else "strain"]
        assert [array for array, _ in scene.particles.arrays] == expected
        assert scene.particles.history_names == []
        scene.traction("top", (0.0, -0.01))
        scene.solve()


@pytest.mark.parametrize("name", FORMS | FINITE)
@pytest.mark.parametrize("kind", ["static", "dynamic"])
def test_the_bytes_are_those_of_the_arrays(name, kind):
    """The named arrays are all that the storage holds and sends between ranks."""
    law = plastic() if name in MIXED else None
    options = (FORMS | FINITE)[name]
    scene = scene_of(law, **options) if kind == "static" else moving(law=law, **options).scene
    particles, n = scene.particles, scene.num_particles
    names, bytes_each = zip(*particles.arrays, strict=True)
    arrays = list(views(particles, names))
    assert [array.nbytes / n for array in arrays] == list(bytes_each)
    assert sum(array.nbytes for array in arrays) == n * particles.bytes_per_particle
    assert sum(array[:1].size for array in arrays) == particles.rows().shape[1]
    motion = ["velocity", "acceleration", "velocity_gradient", "acceleration_gradient"]
    assert [a for a in names if a in motion] == motion * (kind == "dynamic")


def test_bytes_of_a_static_and_of_a_moving_scene():
    """Doubles but for two numbers of 4 bytes: x 2, V 1, stress 4, displacement 2, strain 4; in motion
    also eps_v 1, history 2, v and a 2 each, their gradients 4 each.
    """
    assert scene_of(form="u").particles.bytes_per_particle == 8 * 13 + 2 * 4
    motion = moving(law=plastic(), form="u_epsv_finite")
    assert motion.scene.particles.bytes_per_particle == 8 * (13 + 1 + 2 + 4 + 8) + 2 * 4


# -- kernels, mass, imports ----------------------------------------------------


@pytest.fixture
def compiled(monkeypatch):
    """Kinds of the kernels that are compiled from now on."""
    kinds: list[str] = []
    make = kernels.compile_kernel

    def counted(comm, form, kind="cell"):
        kinds.append(kind)
        return make(comm, form, kind)

    monkeypatch.setattr(compilation, "_compiled", {})
    monkeypatch.setattr(kernels, "compile_kernel", counted)
    return kinds


@pytest.mark.parametrize(
    ("options", "integrals"),
    [
        ({"form": "u"}, 2),  # residual and tangent
        ({"form": "u_epsv"}, 2),
        ({"form": "u_p"}, 2),
        ({"form": "u_epsv", "stabilisation": "projection"}, 4),  # each at particles and at centres
        ({"form": "u_bbar"}, 8),  # at particles and centres, and two products of two
        ({"form": "u_finite", "ghost_penalty": "off"}, 2),
        # the lumped term is evaluated at the vertices
        ({"form": "u_epsv_finite", "ghost_penalty": "off"}, 4),
    ],
)
def test_only_the_kernels_that_a_scene_needs_are_compiled(compiled, options, integrals):
    scene = scene_of(**options)
    scene.fix("top", "y", -0.01)
    scene.solve()
    assert compiled == ["cell"] * integrals
    assert len(compilation._compiled) == 1
    scene.traction("left", (0.01, 0.0))
    scene.traction("right", (0.01, 0.0))
    scene.solve()
    assert compiled == ["cell"] * integrals  # forces on the border need none


def test_the_ghost_penalty_is_compiled_only_for_cut_cells(compiled):
    scene_of(form="u_epsv", ghost_penalty="on").solve()
    assert sorted(compiled) == ["cell", "cell"]
    grid = grid_of((4, 4))
    body = tawami.box(grid, grid.origin, (0.3, 2.5))
    scene = tawami.Scene(grid, body, tawami.linear_elastic(E=2.0, nu=0.3))
    scene.fix("left", "x")
    scene.fix("bottom", "y")
    scene.solve()
    assert sorted(compiled) == ["cell", "cell", "interior_facet"]


@pytest.mark.parametrize(("density", "penalty"), [(None, "on"), (1e3, "off")])
def test_the_ghost_penalty_is_the_default_of_static_finite_strain(density, penalty):
    for form in ("u_epsv_finite", "u_finite", "u_bbar_finite"):
        model = scene_of(form=form, density=density).configuration.model
        assert model.options["ghost_penalty"] == penalty


def test_a_static_scene_assembles_no_mass(monkeypatch):
    def refuse(*_):
        raise AssertionError("a mass")

    monkeypatch.setattr(Inertia, "adder", refuse)
    monkeypatch.setattr(Domain, "mass", property(refuse))
    scene = scene_of(density=1.0, form="u_epsv_finite")
    scene.traction("top", (0.0, -0.1))
    assert scene.solve().displacement((0.0, 1.9))[1] < -1e-3
    scene.gravity((0.0, -0.1))
    with pytest.raises(AssertionError, match="a mass"):
        scene.solve()
    monkeypatch.undo()
    monkeypatch.setattr(Inertia, "adder", refuse)
    scene.solve()
    with pytest.raises(AssertionError, match="a mass"):
        tawami.Dynamics(scene).step(0.01)


def test_optional_packages_are_imported_only_when_needed(tmp_path):
    code = """
import logging, sys; logging.disable(logging.INFO)
from mpi4py import MPI
import tawami
grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=0.5, cells=(4, 2))
scene = tawami.Scene(grid, tawami.box(grid, (0, 0), (2, 1)), tawami.linear_elastic(E=1e3, nu=0.3))
scene.fix("left", "x")
scene.fix("left", "y")
scene.traction("right", (0.0, -1.0))
solution = scene.solve()
others = ("matplotlib", "meshio", "shapely", "tqdm", "hypothesis", "scipy.spatial", "scipy.optimize")
print(*[name for name in others if name in sys.modules])
tawami.polygon(grid, [(0, 0), (2, 0), (2, 1)])
from tawami.results.single import write_particles
write_particles("p.vtu", solution)
print(*[name for name in others if name in sys.modules])
"""
    command = [sys.executable, "-c", code]
    run = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
    static, more = run.stdout.split("\n")[-3:-1]
    assert static == ""
    assert "shapely" in more.split()


# -- what is not modelled ------------------------------------------------------


@pytest.mark.parametrize(
    ("ask", "message"),
    [
        (lambda s: s.velocity, r"velocity: a scene by itself is static.*Dynamics\(scene, velocity"),
        (lambda s: s.solve().acceleration, r"acceleration: .*needs Scene\(\.\.\., density"),
        (lambda s: s.energies, r"energies: .* expected motion = Dynamics"),
        (lambda s: setattr(s, "velocity", 1.0), "velocity: a scene by itself is static"),
        (lambda s: s.particles.carried("velocity"), r"no array 'velocity': .*Dynamics\(scene, vel"),
        (
            lambda s: s.particles.history("plastic_strain"),
            r"have no history: expected a plastic law, as von",
        ),
        (
            lambda s: s.solve().plastic_strain,
            r"plastic laws, as von_mises.*history\('plastic_strain'",
        ),
        (
            lambda s: s.deformation_gradient,
            r"deformation_gradient: expected .*displacement_gradient, .*u_epsv_finite",
        ),
        (lambda s: s.particles.eps_v, r"eps_v: .*expected one with.*form='u_epsv'"),
        (lambda s: s.solve().eps_v, r"eps_v: form 'u' does not have it.*form='u_epsv'"),
        (lambda s: s.solve().volumetric, r"volumetric: form 'u' .*'mixed' or 'deviatoric'"),
        (lambda s: s.mass, r"mass needs Scene\(\.\.\., density=\.\.\.\)"),
        (lambda s: s.gravity((0, -1)), r"gravity\(...\) needs Scene\(\.\.\., density=\.\.\.\)"),
        (lambda s: tawami.Dynamics(s), r"Dynamics needs Scene\(\.\.\., density=\.\.\.\)"),
        (lambda s: tawami.settle(s), "expected a scene with a form of finite strain"),
        (
            lambda s: s.solve().reaction("top"),
            r"reaction\('top'\): nothing supports .* expected one of 'bottom', or fix\('top'",
        ),
    ],
)
def test_a_quantity_that_is_not_modelled_is_rejected_with_advice(ask, message):
    with pytest.raises(tawami.InputError, match=message):
        ask(scene_of(form="u"))


def test_a_volumetric_strain_is_not_a_pressure():
    solution = scene_of(form="u_p").solve()
    assert solution.volumetric.shape == (5 * 4,)
    with pytest.raises(
        tawami.InputError, match=r"form 'u_p' does not have it.*'mixed', as form='u_e"
    ):
        _ = solution.eps_v
    with pytest.raises(tawami.InputError, match="form='u_epsv_finite'"):
        _ = scene_of(form="u_finite").solve().eps_v


def test_an_unknown_array_is_rejected_with_the_known_ones():
    with pytest.raises(
        tawami.InputError, match=r"'temperature': expected one of.*velocity_gradient"
    ):
        moving().scene.particles.carried("temperature")


def test_a_parameter_without_effect_is_rejected():
    with pytest.raises(tawami.InputError, match=r"k = 0.1: form .* expected ghost_penalty='on'"):
        scene_of(form="u_epsv", k=0.1, ghost_penalty="off")
    scene = scene_of(form="u_epsv", alpha=0.2, k=0.1, ghost_penalty="on")
    assert scene.parameters == {"alpha": 0.2, "k": 0.1, "k_v": 0.03}
    idle = tawami.Form({"u": vector("w")}, _residual,
                       parameters={"beta": {"default": 1.0}})  # fmt: skip
    assert scene_of(form=idle).parameters == {}
    with pytest.raises(tawami.InputError, match=r"beta = 2.0: .* expected no beta"):
        scene_of(form=idle, beta=2.0)


def _residual(w, sigma, sum_p):
    from ufl import grad

    return sum_p(sigma, grad(w))


# -- the header ----------------------------------------------------------------


def test_hasattr_is_false_for_what_is_not_modelled():
    scene = scene_of(form="u")
    assert not hasattr(scene, "velocity")
    assert hasattr(scene, "stopwatch")


def test_a_misspelt_argument_of_a_scene_is_suggested():
    named = inspect.signature(tawami.Scene).parameters.values()
    assert {p.name for p in named if p.kind == p.KEYWORD_ONLY} == set(KEYWORDS)
    with pytest.raises(
        tawami.InputError, match="has no parameter 'densty': .*; did you mean 'density'"
    ):
        scene_of(densty=1000.0)
