"""Forces on particles: one that they share, or one on each; the particles that a script names."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI
from runs import Kill, Killed, results_of
from scenes import greville, grid_of

import tawami


def scene_of(**options):
    grid = grid_of()
    body = tawami.box(grid, grid.origin, grid.upper, per_axis=2, gauss=True)
    return tawami.Scene(grid, body, tawami.linear_elastic(E=10.0, nu=0.3), **options)


def resultant(scene):
    """Force, and moment about the origin."""
    grid = scene.grid
    n = 2 * (grid.cells[0] + 2) * (grid.cells[1] + 2)
    force = scene.configuration.external()[:n].reshape(-1, 2)
    x, y = (
        o + grid.h * greville(scene.basis, k) for o, k in zip(grid.origin, grid.cells, strict=True)
    )
    x, y = np.tile(x, len(y)), np.repeat(y, len(x))
    return np.array([*force.sum(axis=0), x @ force[:, 1] - y @ force[:, 0]])


def expected(x, forces):
    return np.array([*forces.sum(axis=0), x[:, 0] @ forces[:, 1] - x[:, 1] @ forces[:, 0]])


@pytest.mark.parametrize("chosen", ["mask", "numbers", "function"])
def test_a_force_on_each_particle_has_its_resultant(chosen):
    scene = scene_of()
    x = np.array(scene.particles.x)
    numbers = np.flatnonzero(x[:, 1] > 1.4)
    given = numbers
    if chosen == "mask":
        given = x[:, 1] > 1.4
    elif chosen == "function":
        given = lambda x, y: y > 1.4  # noqa: E731
    else:
        given = numbers = numbers[::-1]
    forces = np.random.default_rng(0).standard_normal((len(numbers), 2))
    load = scene.load(given, forces, amplitude=3.0)
    sums = 3 * expected(x[numbers], forces)
    assert resultant(scene) == pytest.approx(sums, rel=1e-12, abs=1e-12)
    load.change(2 * forces, amplitude=1.0)
    assert resultant(scene) == pytest.approx(2 / 3 * sums, rel=1e-12, abs=1e-12)
    load.change((1.0, 0.0))  # one that they share
    assert resultant(scene)[:2] == pytest.approx([1.0, 0.0], rel=1e-12)
    load.release()
    assert not resultant(scene).any()


@pytest.mark.parametrize("n", [1, 2])
def test_a_row_is_a_force_on_a_particle_and_two_numbers_are_shared(n):
    """Whatever the number of particles: two rows of two numbers are no total."""
    rows, total = scene_of(), scene_of()
    rows.load(np.arange(n), np.full((n, 2), [3.0, -1.0]))
    total.load(np.arange(n), [3.0, -1.0])
    assert resultant(rows)[:2] == pytest.approx([3.0 * n, -1.0 * n], rel=1e-12)
    assert resultant(total)[:2] == pytest.approx([3.0, -1.0], rel=1e-12)


def test_forces_of_particles_grow_and_change_as_other_loads_do():
    """In a ramp; a uniform force per volume is the weight."""
    scene, weighed = scene_of(density=2.0), scene_of(density=2.0)
    for one in (scene, weighed):
        one.fix("bottom", "x")
        one.fix("bottom", "y")
    forces = np.outer(scene.particles.volume, [0.0, -2.0])
    load, found = scene.load(np.arange(scene.num_particles), forces), []
    weighed.gravity((0.0, -1.0))
    solution = scene.solve()
    np.testing.assert_allclose(solution.u, weighed.solve().u, rtol=1e-9, atol=1e-12)
    load.change(3 * forces)
    tawami.ramp(scene, 0.5, each=lambda s: found.append(s.reaction("bottom")[1]))
    weight = -forces[:, 1].sum()
    assert found == pytest.approx([2 * weight, 3 * weight], rel=1e-6)


def test_a_run_with_forces_of_particles_is_resumed(tmp_path):
    """To the bit; forces that changed while it ran are restored, others are rejected."""

    def run_in(folder, kill, share=1.0):
        scene = scene_of(tolerance=1e-10)
        scene.fix("bottom", "x")
        scene.fix("bottom", "y")
        load = scene.load(lambda x, y: y > 1.5, np.full((16, 2), [0.1 * share, 0.2]))

        def each(solution):
            if solution.load == 0.25:
                load.change(np.full((16, 2), [-0.3, 0.1]))
            kill(solution)

        results = results_of(tmp_path / folder, checkpoint_steps=1, keep=1)
        tawami.ramp(scene, 0.25, each=each, results=results)
        return scene.particles.rows().tobytes()

    whole = run_in("whole", Kill())
    with pytest.raises(Killed):
        run_in("cut", Kill(3))
    with pytest.raises(tawami.CheckpointError, match="belongs to another run: loads"):
        run_in("cut", Kill(), share=1.1)
    assert run_in("cut", Kill()) == whole


def test_wrong_forces_and_particles_raise_an_error():
    scene = scene_of()
    n = scene.num_particles
    for force, words in (
        (
            np.ones((3, 2)),
            r"force has shape \(3, 2\): expected \(2, 2\), one row for each of the 2 par",
        ),
        (np.ones((2, 3)), r"force has shape \(2, 3\): expected \(2, 2\)"),
        (np.ones(3), "expected two numbers"),
        (np.ones((2, 2, 1)), "expected a number"),
        ([[1.0, 2.0], [np.nan, 0.0]], r"force\[1\] = \[nan"),
        ([["a", "b"], ["c", "d"]], "expected an array of real numbers"),
    ):
        with pytest.raises(tawami.InputError, match=words):
            scene.load([0, 1], force)
    with pytest.raises(tawami.InputError, match="a particle is given twice"):
        scene.load([1, 1], np.ones((2, 2)))
    for particles, words in (
        (
            lambda x, y: 2 * x,
            f"the function gave float64 of shape .* for {n} positions: expected True",
        ),
        (lambda x, y: 1 / 0, "the function gave ZeroDivisionError"),
        (lambda x, y: x > 99, "no particle was chosen"),
        ("clay", r"the body has no groups with names: expected a body of body.named\(...\)"),
        (
            np.ones(n - 1, dtype=bool),
            f"expected a mask of the {n} particles of the body, or their num",
        ),
    ):
        with pytest.raises(tawami.InputError, match=words):
            scene.load(particles, (1.0, 0.0))
    assert not scene.configuration.loads.all


def test_particles_are_named_by_their_group():
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=0.5, cells=(2, 2))
    box = tawami.box(grid, (0, 0), (1, 1), per_axis=2)
    upper = (box.x[:, 1] > 0.5).astype(np.uint32)
    body = tawami.Body(box.x, box.volume, upper, ("clay", "sand"))
    law = tawami.linear_elastic(E=10.0, nu=0.3)
    scene = tawami.Scene(grid, body, {"clay": law, "sand": law})
    load = scene.load("sand", (0.0, -8.0))
    assert load.shares.number.tolist() == np.flatnonzero(upper).tolist()
    with pytest.raises(tawami.InputError, match="= 'silt': expected 'clay' or 'sand'"):
        scene.load("silt", (0.0, -8.0))
