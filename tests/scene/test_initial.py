"""Initial fields of a scene: their sources, and their meaning to the laws."""

from __future__ import annotations

import numpy as np
import pytest
from k0_column import HEIGHT, K0, LAWS, RHO, SOIL, G, column, k0
from scenes import grid_of

import tawami


@pytest.mark.parametrize("form", ["u", "u_epsv", "u_epsv_finite", "u_finite"])
@pytest.mark.parametrize("law", LAWS)
def test_a_column_in_its_k0_state_is_in_equilibrium(law, form):
    scene = column(law, form)
    scene.initial("stress", k0)
    before = scene.particles.stress.copy()
    solution = scene.solve()
    assert solution.iterations == 0
    assert np.abs(solution.displacement_of_particles).max() == 0
    assert solution.stress == pytest.approx(before, rel=1e-11, abs=1e-6)
    assert solution.reaction("bottom")[1] == pytest.approx(RHO * G * 2 * HEIGHT)
    assert solution.reaction("left")[0] == pytest.approx(K0 * RHO * G * HEIGHT**2 / 2)


def test_a_k0_state_serves_the_u_p_form():
    scene = column(form="u_p")
    scene.initial("stress", k0)
    assert np.abs(scene.solve().displacement_of_particles).max() == 0


def test_a_motion_from_a_k0_state_stays_at_rest():
    scene = column("mohr_coulomb", "u_epsv_finite")
    scene.initial("stress", k0)
    motion = tawami.Dynamics(scene)
    motion.run(end=0.05, dt=0.01)
    assert np.abs(scene.particles.displacement).max() < 1e-12
    assert motion.energies.kinetic < 1e-20


def test_a_column_without_equilibrium_is_compressed():
    """With half of the stress, the rest of the weight compresses it by rho g H^2 / (4 M)."""
    scene = column()
    scene.initial("stress", lambda x, y: [part * 0.5 for part in k0(x, y, 3 / 7)])
    M = SOIL.bulk_modulus + 4 / 3 * SOIL.shear_modulus
    top = scene.solve().displacement((1.0, HEIGHT))[1]
    assert top == pytest.approx(-RHO * G * HEIGHT**2 / (4 * M), rel=2e-3)


@pytest.mark.parametrize("law", ["mohr_coulomb", "drucker_prager"])
@pytest.mark.parametrize("form", ["u_epsv", "u_epsv_finite"])
def test_a_stress_beyond_the_yield_surface_is_rejected_or_returned_to_it(law, form):
    """phi = 30 degrees: K between 1/3 and 3 (Rankine). Drucker-Prager agrees in plane strain only, where
    sigma_zz is that of flow without volume change: the mean of the others.
    """

    def stress(K):
        def f(x, y):
            sxx, syy, _, sxy = k0(x, y, K)
            return sxx, syy, (sxx + syy) / 2, sxy

        return f

    for allowed in (0.34, 1.0, 2.95):
        column(law, form).initial("stress", stress(allowed))
    for beyond in (0.3, 3.2):
        scene = column(law, form)
        message = r"stress of particle \d+ at \(.*\) Pa, beyond the yield surface by .* 127 others"
        with pytest.raises(tawami.InputError, match=message):
            scene.initial("stress", stress(beyond))
        assert not scene.particles.stress.any()
        scene.initial("stress", stress(beyond), beyond="return")
        sxx, syy = scene.particles.stress[:, 0], scene.particles.stress[:, 1]
        ratio = np.maximum(sxx / syy, syy / sxx)
        if law == "mohr_coulomb":
            assert ratio == pytest.approx(3.0, rel=1e-6)
        scene.initial("stress", np.array(scene.particles.stress))  # it is on the surface now


def test_hardening_is_set_before_the_stress():
    scene = column(tawami.von_mises(SOIL, yield_stress=1e3, hardening=1e5))
    stress = np.array([1500.0, 0.0, 0.0, 0.0])
    with pytest.raises(tawami.InputError, match="beyond the yield surface"):
        scene.initial("stress", stress)
    with pytest.raises(tawami.InputError, match="plastic_strain of particle 0 is -1: expected 0"):
        scene.initial("plastic_strain", -1.0)
    scene.initial("plastic_strain", 0.006)
    scene.initial("stress", stress)
    assert (scene.particles.stress == stress).all()
    with pytest.raises(tawami.InputError, match="beyond the yield surface"):
        scene.initial("plastic_strain", lambda x, y: 0 * x)
    assert (scene.particles.history("plastic_strain") == 0.006).all()


def test_eps_v_fits_the_stress_of_an_elastic_law():
    scene = column()
    scene.initial("stress", k0)
    mean = scene.particles.stress[:, :3].mean(axis=1)
    assert scene.particles.eps_v == pytest.approx(mean / SOIL.bulk_modulus)
    with pytest.raises(
        tawami.InputError, match=r"eps_v of particle 0 is 0.01, which gives an elastic"
    ):
        scene.initial("eps_v", 0.01)
    scene.initial("eps_v", 0.0)  # counted from this state
    assert not scene.particles.eps_v.any()
    plastic = column("mohr_coulomb")
    plastic.initial("stress", k0)
    plastic.initial("eps_v", 0.01)
    assert (plastic.particles.eps_v == 0.01).all()


def test_a_loaded_and_a_given_state_respond_alike():
    """The state that a scene was loaded to, given to another scene: the next response is the same."""
    first, second = column(), column()
    first.solve()
    for name in ("stress", "eps_v", "displacement"):
        array = np.array(getattr(first.particles, name))
        second.initial(name, array)
        assert np.array_equal(getattr(second.particles, name), array)
    for scene in (first, second):
        scene.load(np.arange(4), (0.0, -1e4))
    assert second.solve().stress == pytest.approx(first.solve().stress, rel=1e-9, abs=1.0)


def test_fields_are_given_as_numbers_arrays_and_functions():
    scene = column()
    x, y = scene.particles.x.T
    n = len(x)
    one = np.array([-3.0, -5.0, -3.0, 0.5])
    for given in (one, list(one), np.tile(one, (n, 1)), lambda x, y: one, lambda x, y: tuple(one)):
        scene.initial("stress", given)
        assert (scene.particles.stress == one).all()
    scene.initial("displacement", lambda x, y: np.column_stack([x, -y]))
    assert np.array_equal(scene.particles.displacement, np.column_stack([x, -y]))
    motion = tawami.Dynamics(scene, velocity=lambda x, y: (y, 0.0))
    assert np.array_equal(motion.velocity, np.column_stack([y, 0 * y]))


@pytest.mark.parametrize(
    ("name", "source", "message"),
    [
        ("strain", 0.0, "initial\\('strain'\\): expected one of 'stress', 'displacement', 'eps_v'"),
        ("velocity", 0.0, r"velocities come in as Dynamics\(scene, velocity=...\)"),
        ("plastic_strain", 0.0, "expected one of 'stress', 'displacement', 'eps_v', which this scene"),
        ("stress", 1.0, r"stress has shape \(\): expected 4 numbers, an array of 128 x 4 \(one row for"),
        ("stress", [1.0, 2.0, 3.0], r"stress has shape \(3,\): expected 4 numbers, an array of 128 x 4"),
        ("stress", "high", r"stress has the value 'high': expected 4 numbers"),
        ("stress", [1.0, 2.0, np.nan, 0.0], r"stress of particle 0 is \(1, 2, nan, 0\) Pa: expec"),
        ("stress", lambda x, y: (x, y), "the function returned .* for 128 positions: expected 4 such"),
        ("stress", lambda x, y: (x, y[16:], x, y), r"parts of shape \(128,\), \(112,\), .* expected 4"),
        ("stress", lambda x: x, "the function failed on arrays of 128 positions"),
        ("stress", lambda x, y: (x / (x - x), y, y, y), r"stress of particle 0 is \(inf"),
        ("eps_v", np.zeros(3), r"eps_v has shape \(3,\): expected a number, an array of 128 \(one for"),
        ("eps_v", lambda x, y: x[1:], "the function returned .* expected an array of that length"),
        ("displacement", np.zeros((128, 3)), r"displacement has shape \(128, 3\): expected two numbers"),
    ],
)  # fmt: skip
@pytest.mark.filterwarnings("ignore:divide by zero")
def test_a_wrong_field_is_rejected(name, source, message):
    scene = column()
    with pytest.raises(tawami.InputError, match=message):
        scene.initial(name, source)
    assert not scene.particles.stress.any()


def test_initial_fields_are_set_before_the_first_solve_and_the_motion():
    solved, moving = column(), column()
    solved.solve()
    tawami.Dynamics(moving)
    for scene in (solved, moving):
        before = scene.particles.stress.copy()
        with pytest.raises(tawami.InputError, match="after the scene was solved or set in motion"):
            scene.initial("stress", k0)
        assert np.array_equal(scene.particles.stress, before)
    with pytest.raises(tawami.InputError, match="beyond = 'ignore': expected 'stop' or 'return'"):
        column().initial("stress", k0, beyond="ignore")


def test_a_law_in_numpy_rejects_a_stress_too():
    """A law without tensile strength."""

    def respond(strain, stress):
        stress = np.minimum(stress, 0.0)
        return stress, np.broadcast_to(np.eye(4), (len(strain), 4, 4))

    grid = grid_of()
    body = tawami.box(grid, grid.origin, grid.upper, per_axis=2)
    scene = tawami.Scene(grid, body, tawami.NumpyLaw(respond, K=1.0, mu=1.0))
    scene.initial("stress", [-1.0, -2.0, -1.0, 0.0])
    with pytest.raises(tawami.InputError, match=r"returns it, \(-1, 0, -1, 0\) Pa"):
        scene.initial("stress", [-1.0, 2.0, -1.0, 0.0])
