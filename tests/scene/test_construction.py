"""Particles that are removed and laws that are replaced between two steps."""

from __future__ import annotations

import warnings

import meshio
import numpy as np
import pytest
from mpi4py import MPI
from runs import Kill, Killed, results_of

import tawami

E, RHO, G, HEIGHT = 1e6, 2000.0, 10.0, 2.0
FORMS = ("u", "u_epsv", "u_finite", "u_epsv_finite")


def column(form="u_epsv", law=None, *, body=None, **options):
    """A column of 1 m x 2 m in one-dimensional strain on a smooth base, with its weight."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=0.25, cells=(4, 10))
    body = body or tawami.box(grid, (0, 0), (1, HEIGHT), gauss=True)
    law = law or tawami.linear_elastic(E=E, nu=0.0)
    options = {"density": RHO, "tolerance": 1e-10} | options
    scene = tawami.Scene(grid, body, law, form=form, **options)
    scene.fix("bottom", "y")
    for edge in ("left", "right"):
        scene.fix(edge, "x")
    return scene


def rise(scene, before):
    """Distances by which the particles have moved since then, by their numbers."""
    return scene.particles.displacement - before[scene.particles.number]


# -- particles that are removed ------------------------------------------------------


@pytest.mark.parametrize("form", FORMS)
def test_an_excavated_column_rebounds_by_the_closed_form(form):
    """u(y) = rho g h y / E for a layer of height h: in steps of a ramp, and with one solve."""
    depth, found = 0.5, list[float]()
    # at finite strain the column is so stiff that strains are small
    law = tawami.linear_elastic(E=1e3 * E if "finite" in form else E, nu=0.0)
    stiffness = law.bulk_modulus * 3
    for at_once in (False, True):
        scene = column(form, law, tolerance=1e-9 if "finite" in form else 1e-10)
        scene.gravity((0.0, -G))
        scene.solve()
        found.clear()
        before = np.array(scene.particles.displacement)
        y = np.array(scene.particles.x[:, 1])
        removed = scene.remove(lambda x, y: y > HEIGHT - depth)
        assert removed.volume == pytest.approx(depth, rel=1e-12)
        assert removed.mass == pytest.approx(RHO * depth, rel=1e-12)
        if at_once:
            found.append(scene.solve().reaction("bottom")[1])
        else:
            tawami.ramp(scene, 0.5, each=lambda s: found.append(s.reaction("bottom")[1]))
        weight = RHO * G * HEIGHT
        released = RHO * G * depth
        expected = [weight - released] if at_once else [weight - released / 2, weight - released]
        assert found == pytest.approx(expected, rel=1e-7)
        u = RHO * G * depth * y / stiffness
        kept = np.array(scene.particles.number)
        error = 1e-4 if scene.form.strain.finite else 1e-8
        np.testing.assert_allclose(rise(scene, before)[:, 1], u[kept], rtol=0, atol=error * u.max())
        assert scene.solve().history[0][0] < 1e-5  # no force remains to fade


def test_outputs_and_numbers_are_those_of_the_particles_that_stay():
    scene = column()
    scene.gravity((0.0, -G))
    scene.solve()
    n, top = scene.num_particles, scene.particles.x[:, 1] > 1.5
    removed = scene.remove(top)
    assert removed.number.tolist() == np.flatnonzero(top).tolist()
    assert [number for number, _, _ in scene.left] == np.flatnonzero(top).tolist()
    assert all(np.isnan(time) for _, _, time in scene.left)
    assert f"particles     {n - top.sum()} ({top.sum()} have left)" in scene.header()
    assert "forces of removed particles or replaced laws until they fade" in scene.header()
    solution = scene.solve()
    assert solution.number.tolist() == np.flatnonzero(~top).tolist()
    assert "until they fade" not in scene.header()
    with pytest.raises(tawami.InputError, match="no body there"):
        solution.displacement((0.5, 1.9))
    again = scene.remove([0, 1, int(np.flatnonzero(top)[0])])  # one of them is gone already
    assert again.number.tolist() == [0, 1]
    assert scene.num_particles == n


def test_files_of_a_run_have_the_particles_of_their_step(tmp_path):
    scene = column()
    scene.gravity((0.0, -G))
    outputs = [
        tawami.ParticleOutput("stress", "displacement", every_steps=1),
        tawami.TableOutput("particles", every_steps=1),
    ]
    results, counts = tawami.Results(tmp_path / "run", *outputs, progress=False), []

    def each(solution):
        counts.append(len(solution.number))
        if solution.load == 0.5:
            scene.remove(lambda x, y: y > 1.5)

    tawami.ramp(scene, 0.5, results=results, each=each)
    tawami.ramp(scene, 1.0, results=results)
    assert counts == [288, 216]
    found = {
        str(path.relative_to(tmp_path / "run")): len(meshio.read(path).points)
        for path in (tmp_path / "run").rglob("*.vtu")
    }
    assert sorted(found.values()) == [216, 216, 216, 288, 288]


def test_the_share_of_a_load_goes_with_its_particles():
    """The rest of the load stays; a traction is released before its cells are removed."""
    scene = column()
    scene.load(lambda x, y: y > 1.0, (0.0, -8.0))
    scene.traction(lambda x, y: (x == 0) & (y < 0.25), (0.0, 0.0))
    found = []
    scene.solve()
    scene.remove(lambda x, y: y > 1.5)
    tawami.ramp(scene, 0.5, each=lambda s: found.append(s.reaction("bottom")[1]))
    assert found == pytest.approx([6.0, 4.0], rel=1e-6)
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=0.25, cells=(4, 8))
    scene = tawami.Scene(grid, tawami.box(grid, (0, 0), (1, 2)), tawami.linear_elastic(E=E, nu=0.0))
    scene.fix("bottom", "x")
    scene.fix("bottom", "y")
    push = scene.traction("top", (0.0, -2.0))
    scene.solve()
    stress = np.array(scene.particles.stress)
    with pytest.raises(tawami.SupportError, match=r"traction\('top'\) would load no particles"):
        scene.remove(lambda x, y: y > 1.5)
    np.testing.assert_array_equal(stress, scene.particles.stress)
    assert not scene.left
    push.release()
    scene.remove(lambda x, y: y > 1.5)
    found.clear()
    tawami.ramp(scene, 0.5, each=lambda s: found.append(s.reaction("bottom")[1]))
    assert found == pytest.approx([1.0, 0.0], abs=1e-5)


def test_supports_on_removed_particles_and_wrong_selections_raise_an_error():
    scene = column()
    held = scene.hold((0.5, 1.9), "y")
    scene.gravity((0.0, -G))
    scene.solve()
    state = scene.particles.rows().tobytes()
    with pytest.raises(
        tawami.SupportError,
        match=r"hold\(point=\(0.5, 1.9\)\) y would hold no particles.*release\(\) it before",
    ):
        scene.remove(lambda x, y: y > 1.25)
    with pytest.raises(tawami.SupportError, match=r"fix\('bottom'\) y would hold no particles"):
        scene.remove(lambda x, y: y < 0.5)
    for where, words in (
        (lambda x, y: y > 9, r"remove\(...\): where: no particle was chosen"),
        (lambda x, y: y > -1, r"remove\(...\) of all particles: expected some that remain"),
        ("clay", "the body has no groups with names"),
    ):
        with pytest.raises(tawami.InputError, match=words):
            scene.remove(where)
    assert scene.particles.rows().tobytes() == state
    held.release()  # as the message advises
    scene.remove(lambda x, y: y > 1.25)
    gone = [number for number, _, _ in scene.left]
    with pytest.raises(tawami.InputError, match="the particles have left the body already"):
        scene.remove(gone)


# -- laws that are replaced ----------------------------------------------------------


@pytest.mark.parametrize("form", FORMS)
def test_a_column_whose_modulus_changes_keeps_its_stress(form):
    """The body does not move. A further load meets the new modulus, in a part of the column or all."""
    stiff = 1e3 if "finite" in form else 1.0  # small strains
    law, new = (tawami.linear_elastic(E=E * stiff * k, nu=0.0) for k in (1.0, 0.25))
    part = 2.0 if "epsv" in form else 1.0  # eps_v has no jumps
    options = {"tolerance": 1e-9} if "epsv" in form else {"basis": "bilinear"}
    scene = column(form, law, **options)
    push = scene.load(lambda x, y: y > 1.75, (0.0, -1e3))
    scene.solve()
    stress, before = np.array(scene.particles.stress), np.array(scene.particles.displacement)
    scene.change_material(lambda x, y: y < part, new)
    np.testing.assert_array_equal(stress, scene.particles.stress)
    assert scene.solve().history[0][0] < 1e-5
    push.change((0.0, -2e3))
    scene.solve()
    y = np.array(scene.particles.x[:, 1])
    below = y < 1.7  # of the load
    sigma = 1e3 / (E * stiff)
    expected = -sigma * (4 * np.minimum(y, part) + np.maximum(y - part, 0.0))
    error = 1e-8 if form == "u" else 1e-4
    np.testing.assert_allclose(
        rise(scene, before)[below, 1], expected[below], rtol=0, atol=error * 8 * sigma
    )


def test_a_whole_body_follows_its_new_modulus():
    """Also with the factorisation that is kept from step to step, and for a group of the body."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=0.25, cells=(4, 10))
    lower = tawami.box(grid, (0, 0), (1, 1), gauss=True).named("clay")
    body = lower + tawami.box(grid, (0, 1), (1, 2), gauss=True).named("sand")
    law = tawami.linear_elastic(E=E, nu=0.0)
    scene = column(law={"clay": law, "sand": law}, body=body, density={"clay": 1.0, "sand": 3.0})
    weight = scene.gravity((0.0, -1.0))
    scene.solve()
    one = scene.solve().displacement((0.5, 2))[1]
    for group in ("clay", "sand"):
        scene.change_material(group, tawami.linear_elastic(E=2 * E, nu=0.0))
    assert len(scene.laws) == 2
    assert scene.mass.sum() == pytest.approx(4.0)  # densities stay
    weight.change((0.0, -2.0))
    two = scene.solve().displacement((0.5, 2))[1]
    assert two - one == pytest.approx(one / 2, rel=1e-6)


@pytest.mark.parametrize("form", FORMS)
def test_stress_beyond_the_new_strength_is_shed_in_steps(form):
    """A column in shear whose strength falls under a displacement that stays."""
    mu, hardening, top = 1e6, 1e5, 1e-3
    elastic = tawami.linear_elastic(K=1e6, mu=mu)
    strong, weak = (
        tawami.von_mises(elastic, yield_stress=np.sqrt(3) * strength, hardening=hardening)
        for strength in (1e3, 250.0)
    )
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=0.25, cells=(4, 8))
    body = tawami.box(grid, (0, 0), (1, 2), gauss=True)
    scene = tawami.Scene(grid, body, strong, form=form, tolerance=1e-9)
    for edge in ("left", "right", "bottom", "top"):
        scene.fix(edge, "y")
    scene.fix("bottom", "x")
    scene.fix("top", "x", top)
    tawami.ramp(scene, 0.25, stop="raise")
    carried, error = mu * top / 2, 2e-2 if scene.form.strain.finite else 1e-3
    assert scene.particles.stress[:, 3] == pytest.approx(carried, rel=error)
    scene.change_material(np.ones(scene.num_particles, dtype=bool), weak)
    assert scene.laws == ["von_mises (plastic_strain)"]
    found = []
    tawami.ramp(scene, 0.5, each=lambda s: found.append(s.reaction("top")[0]))
    left = (250.0 + hardening * top / 6) / (1 + hardening / (3 * mu))
    assert found == pytest.approx([(carried + left) / 2, left], rel=error)
    assert scene.particles.stress[:, 3] == pytest.approx(left, rel=error)


def test_history_stays_with_a_law_of_the_same_name_and_begins_at_0_with_another():
    elastic = tawami.linear_elastic(E=E, nu=0.3)
    hardening = tawami.von_mises(elastic, yield_stress=1e3, hardening=1e5)
    scene = column("u", hardening)
    scene.load(lambda x, y: y > 1.75, (0.0, -3e3))
    scene.solve()
    strain = np.array(scene.particles.history("plastic_strain"))
    assert strain.min() > 0 or strain.max() > 0
    scene.change_material([0, 1, 2], tawami.von_mises(elastic, yield_stress=2e3))
    np.testing.assert_array_equal(scene.particles.history("plastic_strain"), strain)
    scene.change_material([0, 1], tawami.mohr_coulomb(elastic, phi=30.0, c=1e4))
    assert scene.particles.history_names == ["plastic_strain", "dilatancy"]
    expected = np.where(np.arange(len(strain)) < 2, 0.0, strain)
    np.testing.assert_array_equal(scene.particles.history("plastic_strain"), expected)
    assert scene.laws[0].startswith("von_mises")


@pytest.mark.parametrize("form", ["u_epsv", "u_epsv_finite"])
def test_a_law_with_friction_brings_its_plastic_volume_into_the_form(form):
    """Residual and tangent of an elastic scene that becomes frictional: those of one that was so."""
    elastic = tawami.linear_elastic(E=E, nu=0.3)
    sand = tawami.mohr_coulomb(elastic, phi=30.0, psi=10.0, c=10.0)
    changed, sandy = column(form, elastic), column(form, sand)
    changed.change_material(np.arange(changed.num_particles), sand)
    c = 1e-3 * np.random.default_rng(0).standard_normal(changed.num_coefficients)
    residual, tangent = sandy.residual(c), sandy.tangent(c).toarray()
    scale, largest = np.abs(residual).max(), np.abs(tangent).max()
    np.testing.assert_allclose(changed.residual(c), residual, rtol=0, atol=1e-13 * scale)
    np.testing.assert_allclose(changed.tangent(c).toarray(), tangent, rtol=0, atol=1e-13 * largest)
    assert np.abs(column(form, elastic).residual(c) - residual).max() > 1e-3 * scale


def test_a_law_in_numpy_replaces_another_one():
    def law(modulus):
        def respond(strain, stress):
            tangent = np.diag([modulus, modulus, 0.0, modulus / 2])
            return stress + strain @ tangent, np.broadcast_to(tangent, (len(strain), 4, 4))

        return tawami.NumpyLaw(respond, K=modulus, mu=modulus / 2)

    scene = column("u", law(E))
    push = scene.load(lambda x, y: y > 1.75, (0.0, -1.0))
    one = scene.solve().displacement((0.5, 1.5))[1]
    scene.change_material(lambda x, y: y > -1, law(2 * E))
    push.change((0.0, -2.0))
    assert scene.solve().displacement((0.5, 1.5))[1] == pytest.approx(1.5 * one, rel=1e-6)


def test_wrong_laws_raise_an_error_and_change_nothing():
    scene = column("u")
    state = scene.particles.rows().tobytes()
    for material, words in (
        ("clay", "material = 'clay': expected a material as linear_elastic"),
        (tawami.neo_hookean(E=1.0, nu=0.3), "finite"),
        (tawami.linear_elastic(E=1.0, nu=0.5), "nu"),
    ):
        with pytest.raises(tawami.InputError, match=words):
            scene.change_material([0, 1], material)
    assert scene.particles.rows().tobytes() == state
    assert scene.laws == ["linear_elastic"]
    with pytest.warns(tawami.LockingWarning, match="at particle 3"):
        scene.change_material([3, 4], tawami.linear_elastic(E=1.0, nu=0.4999))


# -- in a run ------------------------------------------------------------------------


def test_changes_from_within_a_step_are_rejected():
    scene = column()

    def removing(t):
        if busy:
            scene.remove([0])
        return 1.0

    def changing(t):
        if busy:
            scene.change_material([0], tawami.linear_elastic(E=1.0, nu=0.3))
        return 1.0

    for amplitude in (removing, changing):
        busy = False
        load = scene.load([5], (0.0, -1.0), amplitude=amplitude)
        busy = True
        with pytest.raises(tawami.InputError, match="was called while a step of this scene"):
            scene.solve(until=scene.time + 1.0)
        busy = False
        load.release()


def staged(results, each, form, soft=0.5):
    """Weight, an excavation while the run goes, another law, a motion after a second excavation."""
    scene = column(form, tawami.linear_elastic(E=1e8, nu=0.2), tolerance=1e-8)
    scene.gravity((0.0, -G))

    def excavating(solution):
        if solution.load == 0.5:
            scene.remove(lambda x, y: y > 1.75)
        if each is not None:
            each(solution)

    steps = [tawami.ramp(scene, 0.25, results=results, each=excavating)]
    scene.remove(lambda x, y: y > 1.5)
    scene.change_material(lambda x, y: y < 0.5, tawami.linear_elastic(E=1e8 * soft, nu=0.2))
    steps.append(tawami.ramp(scene, 0.4, results=results, each=each))
    motion = tawami.Dynamics(scene)

    def digging(solution):
        if motion.steps == 2:
            scene.remove(lambda x, y: (y > 1.25) & (x < 0.5))
        if each is not None:
            each(solution)

    steps.append(motion.run(0.004, 0.001, results=results, each=digging))
    found = scene.particles.rows().tobytes(), str(motion.energies), scene.left.__repr__(), steps
    return found, scene


@pytest.mark.parametrize("form", ["u_epsv", "u_epsv_finite"])
def test_a_killed_run_with_excavations_and_laws_resumes_to_the_bit(tmp_path, form):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", tawami.CheckpointWarning)
        whole, scene = staged(results_of(tmp_path / "whole", checkpoint_steps=1), None, form)
        kill, attempts = Kill(3, 5, 7, 11), 0
        while True:
            attempts += 1
            try:
                found, _ = staged(results_of(tmp_path / "cut", checkpoint_steps=1), kill, form)
                break
            except Killed:
                continue
    assert attempts == 5
    assert found == whole
    assert len(scene.left) == 90
    with (
        pytest.raises(tawami.CheckpointError, match="belongs to another run: laws"),
        pytest.warns(tawami.CheckpointWarning, match="The checkpoint before it is tried"),
    ):
        staged(results_of(tmp_path / "cut"), None, form, soft=0.6)


def test_a_law_that_changes_while_a_run_goes_cannot_be_resumed(tmp_path):
    def run(kill):
        scene = column()
        scene.gravity((0.0, -G))

        def each(solution):
            if solution.load == 0.5:
                scene.change_material([0, 1], tawami.linear_elastic(E=2 * E, nu=0.0))
            kill(solution)

        tawami.ramp(scene, 0.25, results=results_of(tmp_path, checkpoint_steps=1), each=each)

    with pytest.raises(Killed):
        run(Kill(4))
    with pytest.raises(tawami.CheckpointError, match="laws were changed during the run"):
        run(Kill())
