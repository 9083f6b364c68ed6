"""Checkpoints with valid checksums and a wrong content: a state that runs, or one error message."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from functools import reduce
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI
from runs import ELASTIC, Kill, Killed, block, run, static_scene

import tawami
from tawami.base import archive


def places(value: Any, at: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Places of all values in a state, those of dictionaries and lists included."""
    yield at
    if isinstance(value, dict | list):
        for key, item in value.items() if isinstance(value, dict) else enumerate(value):
            yield from places(item, (*at, key))


def forgeries(value: Any) -> Iterator[Any]:
    """Wrong values in place of a value; Ellipsis for none."""
    yield from (..., None, "text", [1, 2], {"a": 1}, True, -3, np.zeros((2, 3)))
    if isinstance(value, np.ndarray) and value.size:
        yield from (value[:-1], value.T, value.ravel(), value.astype(np.float32), value.astype("U"))
        yield from (value.astype(complex), np.concatenate([value, value]), value[:0], -value)
        for bad in (np.nan, np.inf, 1e300, -1e300, 1e18, 0.5):
            forged = value.astype(float)
            forged.flat[value.size // 2] = bad
            yield forged
    elif isinstance(value, int | float):
        yield from (np.nan, np.inf, -value, 1e300, -1e300, 2**70, 0)


def forged(state: Any, at: tuple[Any, ...], value: Any) -> Any:
    """A copy of a state with another value at a place."""
    if not at:
        return value
    key, *rest = at
    copy = dict(state) if isinstance(state, dict) else list(state)
    if value is ... and not rest:
        del copy[key]
    else:
        copy[key] = forged(state[key], tuple(rest), value)
    return copy


def small_strain() -> tawami.Scene:
    scene = static_scene(density=1000.0)
    scene.gravity((0.0, -9.81))
    return scene


def resumed_from_all(scene, folder, begin, step):
    """Resume from every `step`-th forgery; any error but that of tawami fails."""
    outputs = [tawami.TableOutput(), tawami.ParticleOutput("stress", every=0.01)]
    with pytest.raises(Killed):
        run(folder / "run", each=Kill(4), outputs=outputs, scene=scene(), keep=1)
    (file,) = archive.files(folder / "run")
    identity, state = archive.read(file)
    cases = [
        (at, value)
        for at in places(state)
        for value in forgeries(reduce(lambda part, key: part[key], at, state))
        if at or value is not ...
    ]
    assert len(cases) > 1000
    work, rejected = folder / "work", 0
    for at, value in cases[begin::step]:
        shutil.copytree(folder / "run", work)
        archive.write(work / "checkpoints" / file.name, identity, forged(state, at, value))
        try:
            run(work, end=0.02, outputs=outputs, scene=scene())
        except tawami.TawamiError as error:
            rejected += 1
            assert "\n" not in str(error) or isinstance(error, tawami.ConvergenceError)
        except Exception as error:
            error.add_note(f"{at} = {value!s:.200}")
            raise
        shutil.rmtree(work)
    return rejected


def test_a_forged_checkpoint_is_rejected_with_an_error_message(tmp_path):
    assert resumed_from_all(block, tmp_path, 7, 79) > 10


def pressed() -> tawami.Scene:
    """A block on patches under a disc that presses it."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=0.25, cells=(8, 8))
    body = tawami.box(grid, (0.35, 0.1), (1.35, 0.6), per_axis=2)
    scene = tawami.Scene(grid, body, ELASTIC, form="u")
    scene.fix("bottom", "x")
    scene.fix("bottom", "y")
    disc = tawami.rigid_disc((0.85, 1.0), 0.4)
    scene.obstacle(disc, 0.2, where="top", displacement=(0.0, -0.005))
    return scene


def test_forged_arrays_of_border_supports_and_obstacles_are_rejected():
    """Arrays of another length, and with numbers that they cannot have, before anything is solved."""
    scene = pressed()
    scene.solve()
    state, tried = scene.state(), set()
    rooms = ("border", "supports", "obstacles")
    for at in (at for room in rooms for at in places(state[room], (room,))):
        value = reduce(lambda part, key: part[key], at, state)
        if not (isinstance(value, np.ndarray) and value.size):
            continue
        nan = value.astype(float)
        nan.flat[-1] = np.nan
        shorter = nan if at[-1] == "left" else value[:-1]  # some pieces may have been removed
        for wrong in (shorter, np.concatenate([value, value]), nan, value.astype("U")):
            with pytest.raises(tawami.CheckpointError, match="in the checkpoint"):
                scene.restore(forged(state, at, wrong))
        tried.add(at[-1])
    assert tried >= {"x", "area", "reference", "number", "left", "held", "pressure"}
    scene.restore(state)


def test_forged_particles_are_no_initial_state(tmp_path):
    x, number = np.zeros((2, 2)), np.array([[0.0], [1.0]])
    arrays = {"x": x, "number": number, "volume": np.ones((2, 1))}
    states = [{}, {"scene": 3}, {"scene": {"particles": [1]}}]
    wrong = [
        ("x", x[:1]), ("x", x + np.nan), ("x", x.astype(complex)), ("x", 3), ("volume", x[:, :1]),
        ("number", 0 * number), ("number", number - 1), ("number", number + 0.5),
    ]  # fmt: skip
    states += [{"scene": {"particles": arrays | {name: value}}} for name, value in wrong]
    for state in states:
        archive.write(tmp_path / "a.npz", {}, state)
        with pytest.raises(tawami.CheckpointError, match="cannot be used"):
            tawami.earlier(tmp_path / "a.npz")
    archive.write(tmp_path / "a.npz", {}, {"scene": {"particles": arrays}})
    tawami.earlier(tmp_path / "a.npz")


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("scene", [block, small_strain])
def test_many_forged_checkpoints_are_rejected_with_an_error_message(tmp_path, scene):
    """Steps of 1 run all; they take four minutes a scene."""
    assert resumed_from_all(scene, tmp_path, 1, 7) > 100
