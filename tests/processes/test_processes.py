"""Copies, other processes and threads: they work, or an error message says what does."""

from __future__ import annotations

import copy
import multiprocessing
import pickle
import threading

import numpy as np
import pytest
from scenes import grid_of

import tawami


def scene_of(material: tawami.Material | None = None) -> tawami.Scene:
    grid = grid_of((8, 6), 0.25)
    body = tawami.box(grid, grid.origin, grid.upper, per_axis=2)
    law = material or tawami.linear_elastic(E=1e4, nu=0.3)
    scene = tawami.Scene(grid, body, law, density=1000.0)
    scene.fix("left", "x")
    scene.fix("left", "y")
    scene.gravity((0.0, -0.1))
    return scene


def deflection(material: tawami.Material | None = None) -> float:
    return float(scene_of(material).solve().displacement((1.0, 1.0))[1])


def outcome(_: int) -> float | str:
    """The deflection, or the error message, in another process."""
    try:
        return deflection()
    except tawami.TawamiError as error:
        return str(error)


ELASTIC = tawami.linear_elastic(E=1e4, nu=0.3)
FRICTION = {"phi": 1.5, "c": 400.0, "psi": 1.0, "eps_v_max": 0.01, "tiny_angle": True}
LAWS = [
    ELASTIC,
    tawami.linear_elastic(K=3e4, mu=1e4),
    tawami.linear_elastic(E=1e4, one_minus_2nu=1e-12),
    tawami.von_mises(ELASTIC, yield_stress=300.0, hardening=1e3),
    tawami.drucker_prager(ELASTIC, **FRICTION),
    tawami.mohr_coulomb(ELASTIC, **FRICTION),
    tawami.cam_clay(
        ELASTIC, M=1.0, lambda_star=0.2, kappa_star=0.05, preconsolidation=1e3, tension=0.5
    ),
]


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.name)
def test_materials_are_copied_and_pickled(law):
    """The copy gives the same displacement to the bit."""
    for other in (copy.deepcopy(law), copy.copy(law), pickle.loads(pickle.dumps(law))):
        assert other is not law
        assert (other.name, other.history_names) == (law.name, law.history_names)
        assert deflection(other) == deflection(law)
    hyper = tawami.neo_hookean(E=1.0, nu=0.49)
    assert pickle.loads(pickle.dumps(hyper)).bulk_modulus == hyper.bulk_modulus


def test_objects_that_hold_a_communicator_cannot_be_copied():
    scene = scene_of()
    for one in (scene, scene.grid, scene.solve(), tawami.Dynamics(scene_of())):
        for double in (copy.copy, copy.deepcopy, pickle.dumps):
            with pytest.raises(
                tawami.InputError, match=r"^a \w+ cannot be copied, pickled .*Build ano"
            ):
                double(one)
    body = tawami.Body(np.ones((2, 2)), np.ones(2))
    assert np.array_equal(pickle.loads(pickle.dumps(body)).x, body.x)


def test_a_forked_process_raises_an_error():
    """A fork has none of the threads of Rust and would wait for them forever."""
    deflection()
    with multiprocessing.get_context("fork").Pool(1) as pool:
        said = pool.map_async(outcome, [0]).get(60)[0]
    assert "this process was forked" in said
    assert "get_context('spawn')" in said


@pytest.mark.direct  # the process has the solver by default
def test_a_spawned_process_computes():
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        assert pool.map_async(outcome, [0]).get(120) == [deflection()]


def test_two_threads_compute_the_same():
    """They take turns."""
    expected, found = deflection(), list[float | str]()
    threads = [
        threading.Thread(target=lambda: found.extend(map(outcome, range(5)))) for _ in range(2)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert found == [expected] * 10
