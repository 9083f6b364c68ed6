"""Laws written in NumPy, compared with those in Rust."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from mpi4py import MPI
from numpy_laws import drucker_prager, hooke, stiffening, von_mises
from scenes import grid_of, linear_field

import tawami
from tawami.quantities import presentation, quantities

K, MU = 5e3, 1e3
ELASTIC = hooke(K, MU)
STIFFENING = stiffening(K, MU)
SIGMA_Y, HARDENING = 30.0, 200.0


def elastic(strain, stress):
    return stress + strain @ ELASTIC, np.broadcast_to(ELASTIC, (len(strain), 4, 4))


RUST = tawami.von_mises(
    tawami.linear_elastic(K=K, mu=MU), yield_stress=SIGMA_Y, hardening=HARDENING
)
NUMPY = von_mises(K, MU, SIGMA_Y, HARDENING)
DIFFERENCES = von_mises(K, MU, SIGMA_Y, HARDENING, tangent=False)


def block(material, form="u_epsv", tolerance=1e-10, **options):
    """A block between two walls on a rough floor, to be loaded on its top."""
    grid = grid_of((5, 6), h=0.25)
    body = tawami.box(grid, (-1.0, 0.5), (0.0, 1.5), per_axis=2)
    scene = tawami.Scene(grid, body, material, form=form, tolerance=tolerance, **options)
    scene.fix("left", "x")
    scene.fix("bottom", "x")
    scene.fix("bottom", "y")
    return scene


def pressed(scene, force=40.0, steps=2):
    """Solutions while a part of the top is loaded; the block yields there."""
    load = scene.load(lambda x, y: (y > 1.25) & (x < -0.5), (0.0, 0.0))
    solutions = []
    for k in range(1, steps + 1):
        load.change((0.0, -force * k / steps))
        solutions.append(scene.solve())
    return solutions


def assert_same(mine, other, share):
    """Whether two solutions are equal, as a share of the largest number."""
    names = ("stress", "displacement", "strain")
    pairs = [(getattr(s.scene.particles, name) for s in (mine, other)) for name in names]
    pairs.append(s.scene.particles.history("plastic_strain") for s in (mine, other))
    for one, two in pairs:
        np.testing.assert_allclose(one, two, rtol=0, atol=share * np.abs(two).max())


def scene_with(material, form="u_epsv", **options):
    grid = grid_of()
    body = tawami.box(grid, grid.origin, grid.upper, per_axis=3)
    scene = tawami.Scene(grid, body, material, form=form, **options)
    scene.fix("left", "x")
    scene.fix("left", "y")
    scene.traction("right", (3.0, -5.0))
    return scene


@pytest.mark.direct  # agreement beyond the tolerance of an iteration that is not the last
@pytest.mark.parametrize("form", ["u", "u_bbar", "u_epsv", "u_p"])
def test_linear_elasticity_in_numpy_agrees_with_rust(form):
    scenes = [
        scene_with(law, form)
        for law in (tawami.NumpyLaw(elastic, K, MU), tawami.linear_elastic(K=K, mu=MU))
    ]
    solutions = [scene.solve() for scene in scenes]
    for mine, other in (
        (solutions[0].u, solutions[1].u),
        (solutions[0].stress, solutions[1].stress),
    ):
        np.testing.assert_allclose(mine, other, rtol=0, atol=1e-9 * np.abs(other).max())
    again = [scene.solve() for scene in scenes]
    assert [s.iterations for s in again] == [0, 0]


@pytest.mark.parametrize("form", ["u", "u_bbar", "u_epsv"])
def test_newton_uses_the_tangent_of_a_nonlinear_law(form):
    scene = scene_with(STIFFENING, form)
    random = np.random.default_rng(0)
    c, d = 1e-2 * random.standard_normal((2, scene.num_coefficients))
    step = 1e-4
    difference = (scene.residual(c + step * d) - scene.residual(c - step * d)) / (2 * step)
    predicted = scene.tangent(c) @ d
    assert np.abs(difference - predicted).max() < 1e-6 * np.abs(predicted).max()


def test_newton_converges_quadratically():
    scene = scene_with(STIFFENING, tolerance=1e-11)
    scene.traction("right", (300.0, 0.0))
    solution = scene.solve()
    assert 3 <= solution.iterations <= 8
    measures = [max(m) for m in solution.history]
    assert measures[-2] < 1e-4


def test_uniaxial_strain_gives_the_stress_of_the_law():
    """The border is displaced linearly: every particle has the prescribed strain."""
    grid = grid_of()
    body = tawami.box(grid, grid.origin, grid.upper, per_axis=3, gauss=True)
    scene = tawami.Scene(grid, body, STIFFENING, form="u", tolerance=1e-12)
    for edge in ("left", "right", "bottom", "top"):
        scene.fix(edge, "x", lambda x, y: 0.02 * x)
        scene.fix(edge, "y")
    scene.solve()
    expected, _ = STIFFENING.respond(np.array([[0.02, 0, 0, 0]]), np.zeros((1, 4)))
    np.testing.assert_allclose(
        scene.particles.stress, np.tile(expected, (len(scene.particles), 1)), atol=1e-9
    )
    u = linear_field(grid, "quadratic_spline", np.zeros(2), [[0.02, 0], [0, 0]])
    assert scene.residual(u).shape == u.shape


@pytest.mark.parametrize(
    ("respond", "history", "message"),
    [
        (lambda e, s: (s, e, s), (), "returned 3 values for 108 particles from 0 on: expected .stress"),
        (lambda e, s: None, (), "stress that respond returned: expected an array of real numbers"),
        (lambda e, s: (s[:, :3], e), (), r"stress of shape \(108, 3\) for 108 .*expected \(108, 4\)"),
        (lambda e, s: (s, e), (), r"tangent of shape \(108, 4\) for .*: expected \(108, 4, 4\)"),
        (
            lambda e, s: (np.where(np.arange(len(s)) % 50 == 7, np.nan, s.T).T, e), (),
            "stress that is not finite at 3 particles, the first is 7: nan at the strain",
        ),
        (lambda e, s, h: (s, e), ("kappa",), "an array of shape .* as history of 108 particles"),
        (lambda e, s, h: (s, e, {}), ("kappa",), "a dictionary with nothing as .*with 'kappa' behind"),
        (
            lambda e, s, h: (s, {"kappa": h["kappa"][:3]}), ("kappa",),
            r"kappa of shape \(3,\) for 108 particles from 0 on: expected \(108,\)",
        ),
        (lambda e, s, h: (s, {"kappa": h["kappa"] / 0}), ("kappa",), "kappa that is not finite at 108"),
    ],
)  # fmt: skip
@pytest.mark.filterwarnings("ignore:invalid value:RuntimeWarning")
def test_wrong_results_of_a_law_are_rejected(respond, history, message):
    scene = scene_with(tawami.NumpyLaw(respond, K, MU, history))
    with pytest.raises(tawami.InputError, match=rf"NumpyLaw\(lambda\): .*{message}"):
        scene.solve()
    assert not scene.particles.stress.any()


@pytest.mark.parametrize(("bulk", "mu"), [(0.0, 1.0), (1.0, -1.0), (np.inf, 1.0), ("a", 1.0)])
def test_wrong_moduli_are_rejected(bulk, mu):
    with pytest.raises(tawami.InputError, match=r"NumpyLaw\(elastic\): "):
        tawami.NumpyLaw(elastic, bulk, mu)


def test_a_function_of_other_arguments_is_rejected():
    with pytest.raises(
        tawami.InputError, match=r"takes \(strain, stress\): expected .*stress, history"
    ):
        tawami.NumpyLaw(elastic, K, MU, history=("kappa",))
    with pytest.raises(tawami.InputError, match="stress; with history variables NumpyLaw"):
        tawami.NumpyLaw(NUMPY.respond, K, MU)


@pytest.mark.parametrize(
    ("history", "message"),
    [
        ("kappa", "history = 'kappa': expected at most 8 different names"),
        (("kappa", "kappa"), "expected at most 8 different names"),
        (tuple("abcdefghi"), "expected at most 8 different names"),
        (("plastic strain",), "history variable 'plastic strain': expected a name of letters"),
        ((3,), "history variable 3: expected a name of letters"),
        (("stress",), "that particles do not have already"),
        ({"p_c": 3}, "unit of p_c = 3: expected text, as 'Pa'"),
    ],
)
def test_wrong_names_of_history_variables_are_rejected(history, message):
    with pytest.raises(tawami.InputError, match=message):
        tawami.NumpyLaw(NUMPY.respond, K, MU, history)
    tawami.NumpyLaw(NUMPY.respond, K, MU, history=("plastic_strain",))  # the advice


@pytest.mark.parametrize(
    "form", ["u", "u_epsv", "u_p", "u_finite", "u_bbar_finite", "u_epsv_finite"]
)
@pytest.mark.parametrize("law", [NUMPY, DIFFERENCES], ids=["tangent", "differences"])
@pytest.mark.filterwarnings("ignore::tawami.TangentWarning")
def test_von_mises_in_numpy_is_that_in_rust(form, law):
    (*_, mine), (*_, other) = (pressed(block(one, form)) for one in (law, RUST))
    plastic = other.scene.particles.history("plastic_strain")
    assert plastic.max() > 0.01
    assert plastic.min() == 0
    assert_same(mine, other, 1e-9)


@pytest.mark.parametrize("form", ["u_epsv", "u_epsv_finite"])
def test_laws_in_numpy_and_in_rust_agree_in_axisymmetry(form):
    """A cylinder that is pressed around its axis: the hoop is the component zz of the law."""
    solutions = []
    for law in (NUMPY, RUST):
        grid = tawami.Grid(
            MPI.COMM_WORLD, origin=(0.0, 0.0), h=0.25, cells=(6, 6), geometry="axisymmetric"
        )
        body = tawami.box(grid, (0.0, 0.0), (1.0, 1.0), per_axis=2)
        scene = tawami.Scene(grid, body, law, form=form, tolerance=1e-10)
        for edge, component in (("left", "x"), ("bottom", "x"), ("bottom", "y")):
            scene.fix(edge, component)
        scene.load(lambda x, y: (y > 0.75) & (x < 0.5), (0.0, -60.0))
        solutions.append(scene.solve())
    plastic, stress = (solutions[1].scene.particles.history("plastic_strain"), solutions[1].stress)
    assert plastic.max() > 0.01
    assert np.abs(stress[:, 2]).max() > 1.0
    assert_same(*solutions, 1e-9)


@pytest.mark.parametrize("form", ["u", "u_epsv", "u_p", "u_epsv_finite"])
@pytest.mark.filterwarnings("ignore::tawami.TangentWarning")
def test_flow_that_changes_the_volume_is_that_in_rust(form):
    """A form with a field for the volume finds the volume at which the law has the mean stress."""
    elastic = tawami.linear_elastic(K=K, mu=MU)
    rust = tawami.drucker_prager(elastic, phi=20.0, psi=10.0, c=20.0)
    laws = drucker_prager(K, MU, phi=20.0, psi=10.0, c=20.0), rust
    mine, other = (pressed(block(law, form), force=50.0)[-1] for law in laws)
    names = ("stress", "displacement")
    pairs = [[getattr(s.scene.particles, name) for s in (mine, other)] for name in names]
    pairs.append([s.scene.particles.history("dilatancy") for s in (mine, other)])
    assert pairs[-1][1].max() > 1e-3
    for one, two in pairs:
        np.testing.assert_allclose(one, two, rtol=0, atol=1e-7 * np.abs(two).max())


@pytest.mark.parametrize("form", ["u_epsv", "u_epsv_finite"])
def test_each_law_of_a_list_is_called_with_its_own_particles(form):
    """Three layers, a law in Rust between two in NumPy, and the same with laws in Rust alone."""
    calls = {"soft": [], "hard": []}

    def observed(law, name):
        def respond(strain, stress, history):
            calls[name].append((len(strain), len(stress), len(history["plastic_strain"])))
            return law.respond(strain, stress, history)

        return tawami.NumpyLaw(respond, law.K, law.mu, law.history)

    def rust(scale):
        elastic = tawami.linear_elastic(K=scale * K, mu=scale * MU)
        return tawami.von_mises(elastic, yield_stress=SIGMA_Y, hardening=HARDENING)

    layer = tawami.box(grid_of((5, 6), h=0.25), (-1.0, 0.5), (0.0, 1.5), per_axis=2).x[:, 1]
    of = np.digitize(layer, [0.75, 1.0])
    laws = [
        observed(von_mises(K, MU, SIGMA_Y, HARDENING), "soft"),
        rust(2.0),
        observed(von_mises(3 * K, 3 * MU, SIGMA_Y, HARDENING), "hard"),
    ]
    mine = pressed(block(laws, form, material_of=of))[-1]
    other = pressed(block([rust(1.0), rust(2.0), rust(3.0)], form, material_of=of))[-1]
    assert (mine.scene.particles.history("plastic_strain")[of == 2] > 1e-3).any()
    assert_same(mine, other, 1e-9)
    for number, name in ((0, "soft"), (2, "hard")):
        assert set(calls[name]) == {3 * (int((of == number).sum()),)}
    assert mine.scene.laws[0] == "NumpyLaw(respond) (plastic_strain)"


def test_newton_converges_as_fast_with_differences():
    """Three loads: a wrong tangent would take tens of iterations."""
    with pytest.warns(
        tawami.TangentWarning, match=r"NumpyLaw\(respond\) returns no tangent.* 9 times"
    ):
        differences = pressed(block(DIFFERENCES, tolerance=1e-11), steps=3)
    exact = pressed(block(NUMPY, tolerance=1e-11), steps=3)
    assert [s.iterations for s in differences] == [s.iterations for s in exact]
    measures = np.array([max(m) for m in exact[-1].history])
    assert 4 <= exact[-1].iterations <= 8
    assert measures[-1] < 10 * measures[-2] ** 2 / measures[0] + 1e-13


def test_a_law_without_tangent_warns_once_and_calls_its_function_nine_times():
    calls = []

    def respond(strain, stress):
        calls.append(len(strain))
        return stress + strain @ ELASTIC

    scene = scene_with(tawami.NumpyLaw(respond, K, MU), "u")
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        first = scene.solve()
        scene.traction("right", (1.0, 0.0))
        second = scene.solve()
    assert [w.category for w in caught] == [tawami.TangentWarning]
    assert first.iterations == second.iterations == 1
    assert len(calls) % 9 == 0


@pytest.mark.parametrize("form", ["u_epsv", "u_epsv_finite"])
def test_energies_of_a_law_in_numpy_are_those_in_rust(form):
    """Kinetic, elastic and dissipated energy of a block that is thrown against its support."""
    energies = []
    for law in (NUMPY, RUST):
        scene = block(law, form, density=1.0, alpha=0.01)
        motion = tawami.Dynamics(scene, velocity=(-3.0, -8.0))
        motion.run(0.02, 0.002)
        e = motion.energies
        energies.append([e.kinetic, e.elastic, e.dissipated, e.integration])
    assert energies[1][2] > 0.1 * energies[1][1]
    np.testing.assert_allclose(*energies, rtol=1e-6)


def test_a_law_in_numpy_replaces_one_in_rust_with_its_history():
    """The name of the law differs, so history begins at 0; another NumpyLaw of this name keeps it."""
    scene = block(RUST)
    pressed(scene)
    stress = np.array(scene.particles.stress)
    upper = scene.particles.x[:, 1] > 1.0
    plastic = np.array(scene.particles.history("plastic_strain"))
    scene.change_material(upper, NUMPY)
    expected = np.where(upper, 0.0, plastic)
    assert scene.particles.history("plastic_strain") == pytest.approx(expected)
    scene.particles.history("plastic_strain")[:] = plastic
    scene.change_material(upper, von_mises(K, MU, SIGMA_Y, HARDENING))
    assert scene.particles.history("plastic_strain") == pytest.approx(plastic)
    assert scene.solve().iterations == 0
    assert scene.particles.stress == pytest.approx(stress, rel=1e-6, abs=1e-6)
    scene.change_material(upper, RUST)
    assert scene.laws == ["von_mises (plastic_strain)"] * 2


def test_initial_history_moves_the_yield_surface():
    """A start beyond the first yield stress is on the surface that its plastic strain gives."""
    scene = block(NUMPY)
    beyond = np.array([1.0, -1.0, 0.0, 0.0]) * (SIGMA_Y + 0.1 * HARDENING) / np.sqrt(3)
    with pytest.raises(tawami.InputError, match="beyond the yield surface"):
        scene.initial("stress", beyond)
    scene.initial("plastic_strain", 0.1)
    scene.initial("stress", beyond * (1 - 1e-12))
    assert scene.particles.history("plastic_strain") == pytest.approx(0.1)


@pytest.mark.filterwarnings("ignore::tawami.TangentWarning")
def test_the_units_of_history_variables_are_in_the_labels():
    def respond(strain, stress, history):
        return stress + strain @ ELASTIC, {"p_c": history["p_c"] + 2.0, "alpha": history["alpha"]}

    law = tawami.NumpyLaw(respond, K, MU, history={"p_c": "Pa", "alpha": "-"})
    solution = scene_with(law, "u").solve()
    more = quantities.of_scene(solution.scene)
    table = presentation.columns(solution.arrays, ("p_c", "alpha"), (), more)
    assert list(table)[2:] == ["p_c [Pa]", "alpha [-]"]
    assert (table["p_c [Pa]"] == 2.0).all()
