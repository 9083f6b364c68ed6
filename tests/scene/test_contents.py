"""A scene has only the arrays, kernels, masses and imports that it needs; errors name the option that
adds more.
"""

from __future__ import annotations

import re
import subprocess
import sys

import pytest
from scenes import FINITE, FORMS, grid_of

import tawami
from tawami.fem import kernels
from tawami.form import compilation
from tawami.scene.domain import Domain
from tawami.solve.inertia import Inertia

ELASTIC = {"E": 10.0, "nu": 0.3}
STATIC = ["x", "volume", "material", "number", "stress", "displacement"]
MIXED = [name for name, options in (FORMS | FINITE).items() if "epsv" in options["form"]]


def scene_of(law=None, **options):
    """A block that stands on the bottom."""
    grid = grid_of()
    body = tawami.box(grid, grid.origin, grid.upper)
    scene = tawami.Scene(grid, body, law or tawami.linear_elastic(**ELASTIC), **options)
    scene.fix("bottom", "x")
    scene.fix("bottom", "y")
    return scene


def plastic():
    return tawami.drucker_prager(tawami.linear_elastic(**ELASTIC), phi=30.0, c=1.0)


def tresca():
    return tawami.mohr_coulomb(tawami.linear_elastic(**ELASTIC), phi=0.0, c=1.0)


def moving(**options):
    return tawami.Dynamics(scene_of(density=1.0, **options), velocity=(0.1, 0.0))


def views(particles, names):
    """The arrays of these names."""
    for name in names:
        if name in particles.history_names:
            yield particles.history(name)
        elif name in ("x", "eps_v", *STATIC):
            yield getattr(particles, name)
        else:
            yield particles.carried(name)


# -- arrays --------------------------------------------------------------------


@pytest.mark.parametrize("name", FORMS | FINITE)
def test_a_static_elastic_scene_stores_only_the_arrays_of_its_form(name):
    scene = scene_of(**(FORMS | FINITE)[name])
    for _ in range(2):
        assert [array for array, _ in scene.particles.arrays] == STATIC + ["eps_v"] * (
            name in MIXED
        )
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
    """Doubles but for two numbers of 4 bytes: x 2, V 1, stress 4, displacement 2; in motion also
    eps_v 1, history 2, v and a 2 each, their gradients 4 each.
    """
    assert scene_of(form="u").particles.bytes_per_particle == 8 * 9 + 2 * 4
    motion = moving(law=plastic(), form="u_epsv_finite")
    assert motion.scene.particles.bytes_per_particle == 8 * (9 + 1 + 2 + 4 + 8) + 2 * 4


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
        ({"form": "u_epsv", "stabilisation": "projection"}, 4),  # each by two rules
        ({"form": "u_bbar"}, 8),  # as well, and two products of two integrals
        ({"form": "u_finite"}, 2),
        ({"form": "u_epsv_finite"}, 4),  # the lumped term has a rule of its own
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
    assert compiled == ["cell"] * integrals + ["exterior_facet"]


def test_the_ghost_penalty_is_compiled_only_if_it_is_on(compiled):
    scene_of(form="u_epsv", ghost_penalty="on").solve()
    assert sorted(compiled) == ["cell", "cell", "interior_facet"]


def test_a_static_scene_assembles_no_mass(monkeypatch):
    def refuse(*_):
        raise AssertionError("a mass")

    monkeypatch.setattr(Inertia, "reduced", refuse)
    monkeypatch.setattr(Domain, "mass", property(refuse))
    scene = scene_of(density=1.0, form="u_epsv_finite")
    scene.traction("top", (0.0, -0.1))
    assert scene.solve().displacement((0.0, 1.9))[1] < -1e-3
    scene.gravity((0.0, -0.1))
    with pytest.raises(AssertionError, match="a mass"):
        scene.solve()
    monkeypatch.undo()
    monkeypatch.setattr(Inertia, "reduced", refuse)
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
    assert {"meshio", "shapely"} <= set(more.split())


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
            r"deformation_gradient: no form stores it.*u_epsv_finite",
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
            r"reaction\('top'\): nothing supports that edge: expected one of bottom, or fix\('top'",
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
        scene_of(form="u_epsv", k=0.1)
    scene = scene_of(form="u_epsv", alpha=0.2, k=0.1, ghost_penalty="on")
    assert scene.parameters == {"alpha": 0.2, "k": 0.1}
    idle = tawami.Form({"u": ("displacement", "w")}, "displacement", _residual,
                       parameters={"beta": {"default": 1.0}})  # fmt: skip
    assert scene_of(form=idle).parameters == {}
    with pytest.raises(tawami.InputError, match=r"beta = 2.0: .* expected no beta"):
        scene_of(form=idle, beta=2.0)


def _residual(w, sigma, sum_p):
    from ufl import grad

    return sum_p(sigma, grad(w))


# -- the header ----------------------------------------------------------------


def line(header, label):
    """The text after a label of a header, over several lines."""
    text = re.sub(r"\n +", " ", header)
    return re.search(rf"^{label} +(.*)$", text, flags=re.MULTILINE).group(1)


@pytest.mark.parametrize("assembly", ["fast", "reference"])
def test_the_header_counts_particles_bytes_and_unknowns(assembly):
    scene = scene_of(form="u_epsv", assembly=assembly)
    scene.hold((0.0, 1.7), "x", 0.01)
    header = scene.header()
    # 6 x 5 splines in two components, 5 x 4 bilinear functions; 12 along the edge, one by the point
    assert line(header, "unknowns").startswith("67: 60 of u, 20 of eps_v, less 13 that")
    assert scene.solve().unknowns == 67
    assert scene.header() == header
    assert line(header, "particles").startswith("48, 88 bytes each (x 16, volume 8,")
    assert "4.22 kB in all" in header
    assert line(header, "solver").endswith(f"assembly {assembly}, 1 rank")
    assert line(header, "supports") == (
        "fix(edge='bottom') x, fix(edge='bottom') y, hold(point=(0.0, 1.7)) x = 0.01 m"
    )
    data = scene.configuration.domain.responses.data["particle"]
    # sigma 3 and its derivatives 3 x (3 + 1), K, K^2/mu; and K and mu themselves
    assert data.shape[1] == 3 + 12 + 2
    assert f"{8 * (17 + 2)} more each" in line(header, "particles")


def test_only_cells_with_particles_have_unknowns():
    grid = grid_of()
    body = tawami.box(grid, grid.origin, (0.0, 1.5))
    scene = tawami.Scene(grid, body, tawami.linear_elastic(**ELASTIC), form="u")
    assert line(scene.header(), "grid").startswith(
        "4 x 3 cells of 0.5 m from (-1, 0.5) to (1, 2), 4 "
    )
    assert line(scene.header(), "unknowns").startswith("32: 32 of u, less 0 that")  # 4 x 4 splines


def switched(**options):
    """The header of a static scene with one option more."""
    return lambda: scene_of(**{"form": "u"} | options).header()


def with_call(call, **options):
    """The header of a static scene after a call."""

    def header():
        scene = scene_of(form="u", density=1.0, **options)
        call(scene)
        return scene.header()

    return header


@pytest.mark.parametrize(
    ("words", "header"),
    [
        ("inertia", lambda: moving(form="u").header()),
        ("finite strain", switched(form="u_epsv_finite")),
        ("plasticity", switched(law=tresca())),
        ("a field for the volume", switched(form="u_epsv")),
        ("contact", with_call(lambda scene: scene.wall("left"))),
        ("weight", with_call(lambda scene: scene.gravity((0.0, -1.0)))),
    ],
)
def test_each_option_leaves_the_list_of_what_is_not_modelled(words, header):
    assert words in line(switched()(), "not modelled")
    missing = re.findall(r"[\w ]+(?= \()", line(header(), "not modelled"))
    assert words not in [name.strip() for name in missing]


def test_the_header_shows_a_ghost_penalty_and_a_motion():
    assert "ghost penalty (ghost_penalty='on')" in scene_of(form="u_epsv").header()
    ghost = scene_of(form="u_epsv", ghost_penalty="on").header()
    assert "ghost_penalty 'on'" in line(ghost, "form")
    assert "k = 0.01" in line(ghost, "form")
    assert "ghost" not in line(ghost, "not modelled")
    motion = moving(law=plastic(), form="u_epsv_finite")
    motion.scene.load([0, 1, 2], (0.0, 1.0))
    header = motion.header()
    assert line(header, "models") == (
        "inertia, finite strain, particles that move, laws drucker_prager (plastic_strain, dilatancy)"
    )
    assert "transfer affine_flip, damping none" in line(header, "motion")
    assert line(header, "loads") == "force on 3 particles"
    assert "velocity_gradient 32" in line(header, "particles")
    assert "statics between the steps of a motion" in motion.scene.header()
    assert "velocities stay on the grid" in moving(form="u").header()


def test_hasattr_is_false_for_what_is_not_modelled():
    scene = scene_of(form="u")
    assert not hasattr(scene, "velocity")
    assert hasattr(scene, "stopwatch")
