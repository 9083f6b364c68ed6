"""NaN and infinity in every array of the particles during a run, in the step size and in the loads.

An error message must name the array and the particle, and leave everything else unchanged, bit for bit.
Once corrected, the run must continue as if nothing had happened.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial

import numpy as np

import tawami
from cases.extremes import block
from cases.extremes.attempt import Attempt, attempted

SUBJECT = "NaN in motion"
DT, PARTICLE = 0.004, 37
ELASTIC = tawami.linear_elastic(E=block.E, nu=0.3)
LAWS = {
    "linear_elastic": ELASTIC,
    "von_mises": tawami.von_mises(ELASTIC, yield_stress=1e3),
    "mohr_coulomb": tawami.mohr_coulomb(ELASTIC, phi=30.0, c=1e3, psi=5.0),
}


def running(law: str) -> tawami.Dynamics:
    """The spinning block, partly plastic, after three steps."""
    motion = block.spinning(block.scene(law=LAWS[law]), 4.0)
    for _ in range(3):
        motion.step(DT)
    return motion


def put(motion: tawami.Dynamics, name: str, value: float) -> None:
    """Write a value into one entry of the row of `PARTICLE` in an array."""
    particles = motion.scene.particles
    if name == "x":  # read-only for scripts: written as a step does
        x = np.array(particles.x)
        x[PARTICLE, 1] = value
        particles.move_to(x)
        return
    if name in particles.history_names:
        array = particles.history(name)
    elif name in ("volume", "stress", "displacement", "eps_v"):
        array = getattr(particles, name)
    else:
        array = particles.carried(name)
    array.reshape(len(particles), -1)[PARTICLE, -1] = value


def refused(motion: tawami.Dynamics, act: Callable[[], object], words: list[str]) -> float:
    """Perform an act on a run that must fail; returns infinity if it does not.

    Raises:
        TawamiError: The expected error.
        AssertionError: The act has changed something, or the error message lacks one of the words.
    """
    before, energies, time = block.state(motion), motion.energies, motion.time
    try:
        act()
    except tawami.TawamiError as refusal:
        changed = block.changed(before, motion)
        if changed or motion.energies != energies or motion.time != time:
            raise AssertionError(f"changed in spite of the error: {changed}") from refusal
        missing = [word for word in words if word not in str(refusal)]
        if missing:
            raise AssertionError(f"'{refusal}' does not contain {missing}") from refusal
        raise
    return np.inf


def corrupted(law: str, name: str, value: float) -> float:
    """The step after a value was written into an array must fail."""
    motion = running(law)
    put(motion, name, value)
    words = [f"{name}:", f"particle {PARTICLE}"]
    return refused(motion, lambda: motion.step(DT), words)


def mended(law: str, name: str, value: float) -> float:
    """Largest difference from an undisturbed run after the array was corrected."""
    motion, other = running(law), running(law)
    good = block.state(motion)
    put(motion, name, value)
    try:
        motion.step(DT)
    except tawami.InputError:
        for array, values in good.items():
            if array == "x":
                motion.scene.particles.move_to(values)
            elif array == name:
                put(motion, name, values.reshape(len(values), -1)[PARTICLE, -1])
        motion.step(DT)
        other.step(DT)
        one, two = block.state(motion), block.state(other)
        return float(max(np.abs(one[k] - two[k]).max() for k in one))
    return np.inf


def of_the_step(what: str, value: float) -> float:
    """A step size, an end or a load with the value must be rejected."""
    motion = running("linear_elastic")
    if what == "traction":  # of a body that fills its grid
        motion = tawami.Dynamics(block.scene("u", cells=(4, 4)))
    scene = motion.scene

    def pull() -> None:
        scene.traction("top", (0.0, value))
        motion.step(DT)

    def move() -> None:
        scene.fix("left", "x", velocity=lambda t: value)
        motion.step(DT)

    acts: dict[str, tuple[Callable[[], object], str]] = {
        "dt": (lambda: motion.step(value), "dt"),
        "dt of a run": (lambda: motion.run(1.0, value), "dt"),
        "end": (lambda: motion.run(value, DT), "end"),
        "gravity": (lambda: scene.gravity((0.0, value)), "gravity"),
        "load": (lambda: scene.load([3], (value, 0.0)), "load"),
        "traction": (pull, "traction"),
        "velocity of a support": (move, "velocity"),
        "velocity at the start": (
            lambda: tawami.Dynamics(scene, velocity=(value, 0.0)), "velocity",
        ),
    }  # fmt: skip
    act, word = acts[what]
    return refused(motion, act, [word])


def attempts(short: bool) -> Iterator[Attempt]:
    """Every array of every law, and every number that a step takes."""
    values = {"NaN": np.nan, "infinity": np.inf, "-infinity": -np.inf}
    seen: set[str] = set()
    for law in LAWS:
        names = [name for name in block.state(running(law)) if name not in seen]
        seen |= set(names)
        for name in names:
            for text, value in list(values.items())[: 1 if short else None]:
                yield attempted(
                    SUBJECT, f"{text} in {name}", None, partial(corrupted, law, name, value)
                )
            yield attempted(
                SUBJECT, f"NaN in {name}, mended", 0.0,
                partial(mended, law, name, np.nan),
            )  # fmt: skip
    numbers = values | {"0": 0.0, "-1": -1.0}
    for text, value in numbers.items():
        for what in ("dt", "dt of a run"):
            yield attempted(
                SUBJECT, f"{text} as {what}", None,
                partial(of_the_step, what, value),
            )  # fmt: skip
    for text, value in values.items():
        for what in ("end", "gravity", "load", "traction", "velocity of a support",
                     "velocity at the start"):  # fmt: skip
            yield attempted(
                SUBJECT, f"{text} as {what}", None,
                partial(of_the_step, what, value),
            )  # fmt: skip
