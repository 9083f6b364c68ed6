"""NaN and infinity in any array of the particles between two static steps, and in input of a script.

An error message must name the array and the particle before anything is solved. Once corrected, the
scene must continue as if nothing had happened. Positions, numbers and materials are read-only.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

import tawami
from cases.extremes.attempt import Attempt, attempted

SUBJECT = "NaN and infinity"
PARTICLE = 3
VALUES = (float("nan"), float("inf"), -float("inf"))
READ_ONLY = ("x", "material", "number")
STATIC = ("volume", "stress", "displacement", "eps_v")
HISTORY = ("plastic_strain", "dilatancy")


def scene_of(form: str = "u_epsv", **options: Any) -> tawami.Scene:
    """A strip of Drucker-Prager material that yields slightly under its weight."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0.0, 0.0), h=0.25, cells=(8, 4))
    body = tawami.box(grid, grid.origin, grid.upper, per_axis=2)
    law = tawami.drucker_prager(tawami.linear_elastic(E=1e6, nu=0.3), phi=30.0, c=1e3, psi=5.0)
    scene = tawami.Scene(grid, body, law, form=form, density=1e3, **options)
    for component in "xy":
        scene.fix("left", component)
    scene.gravity((0.0, -0.2))
    return scene


def array_of(scene: tawami.Scene, name: str) -> npt.NDArray[np.float64]:
    """An array of the particles by its name."""
    if name in HISTORY:
        return scene.particles.history(name)
    return getattr(scene.particles, name)


def after_a_step() -> tawami.Scene:
    """A scene after one step, with the loads of the next."""
    scene = scene_of()
    scene.solve()
    scene.gravity((0.02, -0.02))
    return scene


def spoiled(name: str, value: float) -> float:
    """Write a value into an array; the error message must name array and particle."""
    scene = after_a_step()
    array_of(scene, name)[PARTICLE] = value
    try:
        scene.solve()
    except tawami.InputError as error:
        sentence = rf"^{name}: \d+ entries are not finite; .* at particle {PARTICLE}\b"
        if not re.search(sentence, str(error)):
            raise RuntimeError(
                f"the message does not name {name} and particle {PARTICLE}: {error}"
            ) from error
        raise
    return 0.0


def mended(name: str, value: float) -> float:
    """Largest difference from an undisturbed scene after the array was corrected."""
    undisturbed, scene = after_a_step(), after_a_step()
    array = array_of(scene, name)
    before = array[PARTICLE].copy()
    array[PARTICLE] = value
    try:
        scene.solve()
    except tawami.InputError:
        array[PARTICLE] = before
    scene.solve()
    undisturbed.solve()
    names = [*READ_ONLY, *STATIC, *HISTORY]
    return max(float(np.abs(array_of(scene, n) - array_of(undisturbed, n)).max()) for n in names)


def passed(value: float) -> dict[str, Callable[[], object]]:
    """Calls of a driver script that pass the value, by name."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0.0, 0.0), h=0.25, cells=(8, 4))
    body, law = tawami.box(grid, (0, 0), (2, 1), per_axis=2), tawami.linear_elastic(E=1.0, nu=0.3)
    bad = np.array(body.volume)
    bad[PARTICLE] = value
    far = np.array(body.x)
    far[PARTICLE, 1] = value

    def solved(call: Callable[[tawami.Scene], None]) -> Callable[[], object]:
        def run() -> object:
            scene = scene_of()
            call(scene)
            return scene.solve()

        return run

    return {
        "Body(volume)": lambda: tawami.Scene(grid, tawami.Body(body.x, bad), law),
        "Body(x)": lambda: tawami.Scene(grid, tawami.Body(far, body.volume), law),
        "density": lambda: tawami.Scene(grid, body, law, density=value),
        "alpha": lambda: tawami.Scene(grid, body, law, alpha=value),
        "E": lambda: tawami.linear_elastic(E=value, nu=0.3),
        "Grid(h)": lambda: tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=value, cells=(1, 1)),
        "traction": solved(lambda scene: scene.traction("right", (value, 0.0))),
        "traction as a function": solved(
            lambda scene: scene.traction("left", (0.0, lambda x, y: value * y))
        ),
        "gravity": solved(lambda scene: scene.gravity((0.0, value))),
        "load": solved(lambda scene: scene.load([0, 1], (value, 0.0))),
        "fix": solved(lambda scene: scene.fix("right", "x", value)),
        "hold": solved(lambda scene: scene.hold((1.0, 0.5), "x", value)),
        "ramp": lambda: tawami.ramp(scene_of("u_epsv_finite"), value),
        "dt": lambda: tawami.Dynamics(scene_of("u_epsv_finite")).step(value),
        "velocity": lambda: tawami.Dynamics(scene_of("u_epsv_finite"), velocity=(value, 0.0)).step(
            1e-3
        ),
    }


def attempts(short: bool) -> Iterator[Attempt]:
    """Each array, call and value. A corrected scene agrees bit for bit."""
    for value in VALUES[:1] if short else VALUES:
        for name in READ_ONLY:
            yield attempted(
                SUBJECT,
                f"{value} in {name}",
                None,
                lambda n=name, v=value: spoiled(n, v),
                refusals=(ValueError,),  # of NumPy: assignment destination is read-only
            )
        for name in (*STATIC, *HISTORY):
            yield attempted(
                SUBJECT, f"{value} in {name}", None, lambda n=name, v=value: spoiled(n, v)
            )
        for name, run in passed(value).items():
            yield attempted(SUBJECT, f"{value} as {name}", None, lambda r=run: _answered(r))
    for name in (*STATIC, *HISTORY):
        yield attempted(SUBJECT, f"{name} mended", 0.0, lambda n=name: mended(n, float("nan")))


def _answered(run: Callable[[], object]) -> float:
    run()
    return 0.0
