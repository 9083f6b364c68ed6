"""Names that a form reads besides fields and laws: x, time, dt, rho, b, old fields, data, parameters."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI
from scenes import grid_of
from ufl import dot, inner

import tawami
from tawami.form import scalar, vector
from tawami.form.compilation import _compiled
from tawami.quantities import presentation, quantities

LAW = {"K": 2.0, "mu": 1.0}
FIELDS = {"u": vector("w"), "c": scalar("r", unit="mol/m3")}


def scene_of(residual, fields=None, *, h=0.5, cells=(4, 3), more=None, **options):
    """A block of random particles that fills its grid, held so that it does not move."""
    form = tawami.Form(fields or FIELDS, residual, **(more or {}))
    grid = grid_of(cells, h=h)
    body = tawami.box(grid, grid.origin, grid.upper, per_axis=2)
    scene = tawami.Scene(grid, body, tawami.linear_elastic(**LAW), form=form, **options)
    for component in "xy":
        scene.fix("bottom", component)
    return scene


def stiff(w, sigma, grad, sum_p):
    """The equation of the displacement."""
    return sum_p(inner(sigma, grad(w)))


def source_of(scene, **given):
    """The residual of the second field, at zero increments, summed over its functions."""
    n = scene.num_coefficients
    return scene.residual(np.zeros(n), **given)[scene.configuration.domain.layout.fields["c"].slice]


def test_position_density_gravity_and_time_are_those_of_the_scene():
    def residual(w, r, sigma, grad, x, rho, b, time, dt, sum_p):
        return stiff(w, sigma, grad, sum_p) + sum_p(rho * dot(b, x) * time / dt * r)

    scene = scene_of(residual, density=[3.0])
    scene.gravity((0.5, -2.0), amplitude=lambda t: 1 + t)
    scene.configuration.activity.time = 4.0
    p = scene.particles
    expected = 3.0 * (1 + 4.0) * (p.volume * (p.x @ [0.5, -2.0])).sum() * 4.0 / 0.1
    assert source_of(scene, dt=0.1).sum() == pytest.approx(expected, rel=1e-13)
    with pytest.raises(tawami.InputError, match="reads dt, and no time passes.*until="):
        scene_of(residual, density=[3.0]).solve()
    with pytest.raises(tawami.InputError, match=r"reads the density rho: .*density="):
        scene_of(residual)


def test_data_are_numbers_functions_or_arrays():
    def residual(w, r, c, sigma, grad, kappa, sum_p):
        return stiff(w, sigma, grad, sum_p) + sum_p(kappa**2, r) + sum_p(dot(grad(r), grad(c)))

    more = {"data": {"kappa": "permeability [m2]"}}
    scene = scene_of(residual, more=more)
    with pytest.raises(tawami.InputError, match=r"reads the data 'kappa' \(permeability \[m2\]\)"):
        scene.solve()
    x, volume = np.array(scene.particles.x), scene.particles.volume
    compiled = len(_compiled)
    for source, values in (
        (2.0, 2.0),
        (lambda x, y: x * y, x[:, 0] * x[:, 1]),
        (x[:, 1], x[:, 1]),
    ):
        scene.data("kappa", source)
        assert source_of(scene).sum() == pytest.approx((volume * values**2).sum(), rel=1e-13)
    assert len(_compiled) == compiled
    scene.fix("top", "c")
    np.testing.assert_array_equal(scene.solve().arrays["kappa"], x[:, 1])
    for name, source, words in (
        ("kapa", 1.0, "expected one of 'kappa'"),
        ("kappa", [1.0, 2.0], "data 'kappa' has shape"),
        ("kappa", np.nan, "expected finite numbers"),
    ):
        with pytest.raises(tawami.InputError, match=words):
            scene.data(name, source)


def test_parameters_in_time_and_of_each_particle():
    def residual(w, r, sigma, grad, beta, sum_p):
        return stiff(w, sigma, grad, sum_p) + sum_p(beta * r)

    more = {"parameters": {"beta": {"default": 1.0, "minimum": 0.0}}}
    scene = scene_of(residual, more=more, beta=lambda t: 2 + t)
    volume = scene.particles.volume.sum()
    scene.configuration.activity.time = 3.0
    assert source_of(scene).sum() == pytest.approx(5 * volume)
    compiled = len(_compiled)
    scene.parameter("beta", 7.0)
    assert source_of(scene).sum() == pytest.approx(7 * volume)
    scene.parameter("beta", lambda t: t**2)
    assert source_of(scene).sum() == pytest.approx(9 * volume)
    assert len(_compiled) == compiled
    with pytest.raises(
        tawami.InputError, match="beta = -1.0: expected a finite number of at least 0"
    ):
        scene.parameter("beta", -1)
    with pytest.raises(tawami.InputError, match="made with one number for all particles"):
        scene.parameter("beta", lambda x, y: x)
    with pytest.raises(tawami.InputError, match="has 'beta'"):
        scene.parameter("gamma", 1.0)

    layered = scene_of(residual, more=more, beta=lambda x, y: 1 + (y > 0.5))
    p = layered.particles
    expected = (p.volume * (1 + (p.x[:, 1] > 0.5))).sum()
    assert source_of(layered).sum() == pytest.approx(expected)
    layered.parameter("beta", p.x[:, 0] ** 2)
    assert source_of(layered).sum() == pytest.approx((p.volume * p.x[:, 0] ** 2).sum())
    with pytest.raises(tawami.InputError, match="beta = -1.0: expected"):
        layered.parameter("beta", -np.ones(len(p)))
    assert "beta of each particle" in layered.header()


def decay(w, r, c, sigma, old, dt, grad, sum_p):
    """d c/dt = lap c - c, backward Euler."""
    new = old.c + c
    rate = sum_p(r * c / dt + dot(grad(r), grad(new)) + r * new)
    return stiff(w, sigma, grad, sum_p) + rate


def test_old_values_and_gradients_are_those_of_the_particles():
    def residual(w, r, sigma, old, grad, sum_p):
        return stiff(w, sigma, grad, sum_p) + sum_p((old.c + grad(old.c)[1]) * r)

    scene = scene_of(residual)
    p = scene.particles
    scene.initial("c", lambda x, y: 1 + 2 * x - 3 * y)
    value = 1 + 2 * p.x[:, 0] - 3 * p.x[:, 1]
    assert source_of(scene).sum() == pytest.approx((p.volume * (value - 3)).sum(), rel=1e-9)


@pytest.mark.parametrize("strain", ["small", "finite"])
def test_a_uniform_field_decays_like_backward_euler(strain):
    def small(w, r, c, sigma, old, dt, grad, sum_p):
        return decay(w, r, c, sigma, old, dt, grad, sum_p)

    def finite(w, r, c, P, old, dt, grad, sum_p):
        return decay(w, r, c, P, old, dt, grad, sum_p)

    scene = scene_of(small if strain == "small" else finite, more={"strain": strain})
    scene.initial("c", 3.0)
    for step in range(1, 4):
        solution = scene.solve(until=0.1 * step)
        np.testing.assert_allclose(solution.field("c"), 3.0 / 1.1**step, rtol=1e-8)


def test_supports_and_fluxes_of_a_field_give_the_linear_solution():
    """Steady: lap c = 0 between c = 1 at the left and a flux of 2 into the right side."""

    def residual(w, r, c, sigma, old, grad, sum_p):
        return stiff(w, sigma, grad, sum_p) + sum_p(dot(grad(r), grad(old.c + c)))

    scene = scene_of(residual)
    scene.fix("left", "c", 1.0)
    flux = scene.flux("right", "c", 2.0)
    solution = scene.solve()
    left = scene.grid.origin[0]
    np.testing.assert_allclose(solution.field("c"), 1 + 2 * (solution.x[:, 0] - left), rtol=1e-9)
    flux.change(lambda x, y: 4.0 + 0 * y)
    again = scene.solve()
    np.testing.assert_allclose(again.field("c"), 1 + 4 * (solution.x[:, 0] - left), rtol=1e-9)
    table = presentation.columns(again.arrays, ("c",), (), quantities.of_scene(scene))
    np.testing.assert_array_equal(table["c [mol/m3]"], again.field("c"))
    with pytest.raises(tawami.InputError, match="a field of the form without a role: 'c'"):
        scene.flux("right", "u", 1.0)
    with pytest.raises(
        tawami.InputError,
        match="component 'p_w': expected one of 'x', .*'tangent', 'c'",
    ):
        scene.fix("left", "p_w", 1.0)
    with pytest.raises(tawami.InputError, match="field 'c' with a velocity"):
        scene.fix("top", "c", velocity=1.0)
    with pytest.raises(tawami.InputError, match=r"field\('d'\): .* has 'c'"):
        again.field("d")


def test_a_field_moves_with_the_particles():
    """A rigid rotation by finite steps keeps values and turns gradients."""

    def residual(w, r, c, P, rho, dt, u, grad, sum_p):
        return stiff(w, P, grad, sum_p) + sum_p(c * r + dot(grad(c), grad(r)))

    form = tawami.Form(FIELDS, residual, strain="finite")
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(-2, -2), h=0.25, cells=(16, 16))
    body = tawami.disc(grid, (0, 0), 1.0)
    scene = tawami.Scene(grid, body, tawami.linear_elastic(K=2e6, mu=1e6), form=form, density=[1e3])
    scene.initial("c", lambda x, y: x)
    motion = tawami.Dynamics(scene, velocity=lambda x, y: (-y, x))
    for _ in range(20):
        solution = motion.step(0.02)
    c, s = np.cos(0.4), np.sin(0.4)
    at_start = solution.x @ [c, s]
    np.testing.assert_allclose(solution.field("c"), at_start, atol=2e-3)
    gradient = scene.particles.carried("c")[:, 1:]
    np.testing.assert_allclose(gradient, np.broadcast_to([c, s], gradient.shape), atol=5e-3)


def test_a_history_variable_is_read_at_the_end_of_the_step():
    def residual(w, r, sigma, plastic_strain, c, grad, sum_p):
        return stiff(w, sigma, grad, sum_p) + sum_p((c - plastic_strain) * r)

    form = tawami.Form(FIELDS, residual)
    grid = grid_of((4, 3), h=0.5)
    body = tawami.box(grid, grid.origin, grid.upper, per_axis=3)
    law = tawami.von_mises(tawami.linear_elastic(E=1e3, nu=0.3), yield_stress=1.0, hardening=50.0)
    scene = tawami.Scene(grid, body, law, form=form)
    scene.fix("bottom", "y")
    scene.fix("left", "x")
    scene.fix("top", "y", -0.02)
    solution = scene.solve()
    plastic = solution.arrays["plastic_strain"]
    assert plastic.max() > 5e-3
    np.testing.assert_allclose(solution.field("c"), plastic, rtol=1e-5)
    assert solution.iterations <= 8


def test_fields_data_and_parameters_are_in_checkpoints(tmp_path):
    def residual(w, r, c, sigma, old, dt, kappa, beta, grad, sum_p):
        new = old.c + c
        return stiff(w, sigma, grad, sum_p) + sum_p(
            r * c / dt + kappa * beta * dot(grad(r), grad(new))
        )

    more = {"data": {"kappa": "conductivity [m2/s]"}, "parameters": {"beta": {"default": 1.0}}}

    def made():
        scene = scene_of(residual, more=more)
        scene.data("kappa", lambda x, y: 1 + x**2)
        scene.fix("left", "c", 1.0)
        scene.initial("c", lambda x, y: x)
        return scene

    scene = made()
    scene.solve(until=0.1)
    scene.parameter("beta", 3.0)
    state = scene.state()
    expected = scene.solve(until=0.2).field("c")
    other = made()
    other.restore(state)
    np.testing.assert_allclose(other.solve(until=0.2).field("c"), expected, rtol=1e-13)


@pytest.mark.parametrize(
    ("residual", "words"),
    [
        (
            lambda w, r, c, sigma, old, grad, sum_p, sum_v: (
                stiff(w, sigma, grad, sum_p) + sum_v(r * (old.c + c))
            ),
            "sum_v: particle data, old fields",
        ),
        (
            lambda w, r, c, sigma, old, grad, sum_p, dx: (
                stiff(w, sigma, grad, sum_p) + r * (old.c + c) * dx
            ),
            "an old field outside a sum over particles",
        ),
        (
            lambda w, r, c, sigma, old, grad, sum_p: (
                stiff(w, sigma, grad, sum_p) + sum_p(r * (old.u[0] + c))
            ),
            "old.u: only fields without a role have an old value",
        ),
        (
            lambda w, r, c, sigma, old, grad, sum_p: (
                stiff(w, sigma, grad, sum_p) + sum_p(r * grad(grad(old.c))[0, 0])
            ),
            "a second derivative of an old field",
        ),
        (
            lambda w, r, c, sigma, kappa, grad, sum_p: (
                stiff(w, sigma, grad, sum_p) + sum_p(r * grad(kappa)[0])
            ),
            r"a derivative of particle data \(kappa\)",
        ),
    ],
)
def test_what_a_form_cannot_read_is_reported_with_its_line(residual, words):
    with pytest.raises(tawami.FormError, match=rf"line \d+ .*{words}"):
        scene_of(residual, more={"data": {"kappa": "conductivity [m2/s]"}})


def test_an_affine_expression_of_a_stress_is_rejected_at_the_centre():
    def residual(w, s, sigma_m, grad, div, sum_p, sum_c):
        return sum_p(inner(s, grad(w))) + sum_c(sigma_m - 100.0, div(w))

    with pytest.raises(tawami.FormError, match="combines with particle constants only"):
        scene_of(residual, {"u": vector("w")}, more={"kinematics": "cell"})


def test_a_penalty_follows_data_that_change():
    def residual(u, w, r, c, sigma, kappa, grad, sum_p, facet_mean, jump_nn, dG, h):
        penalty = facet_mean(kappa) * h**3 * inner(jump_nn(u), jump_nn(w)) * dG
        return stiff(w, sigma, grad, sum_p) + sum_p(r * c) + penalty

    form = tawami.Form(FIELDS, residual, data={"kappa": "stiffness [Pa]"})
    grid = grid_of((8, 8), h=0.25)
    body = tawami.disc(grid, np.add(grid.origin, 1.0), 0.7)
    scene = tawami.Scene(grid, body, tawami.linear_elastic(**LAW), form=form)
    random = np.random.default_rng(0).standard_normal(scene.num_coefficients)
    sizes = []
    for kappa in (0.0, 1.0, 10.0):
        scene.data("kappa", kappa)
        sizes.append(scene.residual(random))
    np.testing.assert_allclose(sizes[2] - sizes[0], 10 * (sizes[1] - sizes[0]), atol=1e-10)
    assert np.abs(sizes[1] - sizes[0]).max() > 0.1


def test_a_ramp_takes_a_field_from_its_present_value_to_the_prescribed_one():
    def residual(w, r, c, sigma, old, grad, sum_p):
        return stiff(w, sigma, grad, sum_p) + sum_p(dot(grad(r), grad(old.c + c)))

    scene = scene_of(residual)
    scene.initial("c", 100.0)
    scene.fix("left", "c", 50.0)
    seen = []
    tawami.ramp(scene, 0.25, each=lambda solution: seen.append(solution.field("c").mean()))
    np.testing.assert_allclose(seen, [87.5, 75.0, 62.5, 50.0], rtol=1e-9)


def test_names_of_arrays_and_histories_are_taken():
    def residual(w, r, c, sigma, plastic_strain, grad, sum_p):
        return stiff(w, sigma, grad, sum_p) + sum_p(r * (c - plastic_strain))

    law = tawami.von_mises(tawami.linear_elastic(**LAW), yield_stress=1.0)
    grid = grid_of((2, 2), h=0.5)
    body = tawami.box(grid, grid.origin, grid.upper, per_axis=2)
    form = tawami.Form(FIELDS, residual, data={"plastic_strain": "given [-]"})
    with pytest.raises(tawami.InputError, match="'plastic_strain' is also an array"):
        tawami.Scene(grid, body, law, form=form)

    def scaled(w, r, c, sigma, stress, grad, sum_p):
        return stiff(w, sigma, grad, sum_p) + sum_p(r * (c - stress))

    more = {"parameters": {"stress": {"default": 1.0}}}
    with pytest.raises(tawami.InputError, match="'stress' is also an array"):
        scene_of(scaled, more=more, stress=lambda x, y: x)


def test_a_checkpoint_keeps_which_parameters_are_functions_of_time():
    def residual(w, r, c, sigma, beta, grad, sum_p):
        return stiff(w, sigma, grad, sum_p) + sum_p(r * (c - beta))

    more = {"parameters": {"beta": {"default": 1.0}}}
    scene = scene_of(residual, more=more, beta=lambda t: 2 + t)
    scene.parameter("beta", 6.0)
    other = scene_of(residual, more=more, beta=lambda t: 2 + t)
    other.restore(scene.state())
    np.testing.assert_allclose(other.solve().field("c"), 6.0, rtol=1e-9)
    scene.parameter("beta", lambda t: 3.0 * t)
    with pytest.raises(tawami.CheckpointError, match="'beta' was a function of time"):
        scene_of(residual, more=more).restore(scene.state())


@pytest.mark.parametrize("rate", [False, True])
def test_removed_weight_fades_in_a_ramp_also_where_a_form_reads_dt(rate):
    def residual(w, r, c, sigma, old, dt, grad, sum_p):
        new = old.c + c
        flow = sum_p(r * (c / dt if rate else c) + dot(grad(r), grad(new)))
        return stiff(w, sigma, grad, sum_p) + flow

    def plain(w, r, c, sigma, old, grad, sum_p):
        return residual(w, r, c, sigma, old, 1.0, grad, sum_p)

    def timed(w, r, c, sigma, old, dt, grad, sum_p):
        return residual(w, r, c, sigma, old, dt, grad, sum_p)

    scene = scene_of(timed if rate else plain, density=[1.0])
    scene.gravity((0.0, -1e-3))
    scene.solve(until=1.0)
    top = np.flatnonzero(scene.particles.x[:, 1] > scene.grid.upper[1] - 0.5)
    scene.remove(scene.particles.number[top].astype(int))
    before, seen = scene.particles.displacement[:, 1].copy(), []
    tawami.ramp(
        scene, 0.5, until=2.0,
        each=lambda solution: seen.append(solution.displacement_of_particles[:, 1] - before),
    )  # fmt: skip
    np.testing.assert_allclose(seen[0], seen[1] / 2, rtol=1e-6)
    assert seen[1].max() > 0


def test_each_input_of_a_form_names_its_call():
    def residual(w, r, c, sigma, grad, beta, kappa, sum_p):
        return stiff(w, sigma, grad, sum_p) + sum_p(beta * r + kappa * dot(grad(c), grad(r)))

    more = {"parameters": {"beta": {"default": 1.0}}, "data": {"kappa": "diffusivity [m2/s]"}}
    scene = scene_of(residual, more=more)
    for call, words in (
        (lambda: scene.data("beta", 1.0), r"is a parameter .*: expected scene.parameter\('beta'"),
        (lambda: scene.data("c", 1.0), r"'c' is a field .*: expected scene.initial\('c'"),
        (lambda: scene.initial("kappa", 1.0), r"'kappa' is data .*: expected scene.data\('kappa'"),
        (lambda: scene.parameter("kappa", 1.0), r"'kappa' is data .*: expected scene.data\('kappa'"),
        (lambda: scene_of(residual, more=more, kappa=3.0), r"Scene\(..., kappa=...\): 'kappa' is data .*"
         r": expected scene.data\('kappa', ...\)"),
        (lambda: scene.parameter("beta", lambda t: "x"), "^parameter 'beta' at 0 s = 'x': expected a"),
        (lambda: scene.parameter("beta", lambda t: 1 / t), r"^parameter 'beta'\(0\) gave ZeroDivis"),
        (lambda: scene.data("kappa", np.ones(5)), r"^data 'kappa' has shape \(5,\): expected a number"),
    ):  # fmt: skip
        with pytest.raises(tawami.InputError, match=words):
            call()
    scene.data("kappa", 1.0)  # as the messages tell
    scene.parameter("beta", 0.0)
    scene.initial("c", 1.0)
    scene.fix("bottom", "c", 1.0)
    with pytest.raises(tawami.InputError, match="did you mean 'c'"):
        scene.solve().field("cc")
