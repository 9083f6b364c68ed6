"""What a phase of a run starts from: two that are alike may go on from the same checkpoint."""

from __future__ import annotations

import hashlib
import json
from typing import TYPE_CHECKING, Any

import numpy as np

from tawami.base import archive
from tawami.particles import placement

if TYPE_CHECKING:
    from tawami.motion.dynamics import Dynamics
    from tawami.scene.scene import Scene

#: Arrays of lengths, and of what is one per second.
LENGTHS = ("x", "displacement", "velocity", "acceleration")
#: Of values of size one.
ROUND_OFF = 1e-12


def identity(scene: Scene, motion: Dynamics | None, name: str) -> dict[str, Any]:
    """What a phase starts from, as far as it decides what comes out; a call for all ranks."""
    grid, form, supports = scene.grid, scene.form, scene.supports
    facts: dict[str, Any] = {
        "phase": name,
        "grid": [list(grid.origin), grid.h, list(grid.cells)],
        "basis": scene.basis,
        "form": form.name,
        "form source": hashlib.sha256(form.source.encode()).hexdigest(),
        "parameters": scene.parameters | scene.options,
        "laws": scene.law_texts,
        "density": scene.densities,
        "tolerance": scene.numerics.tolerance,
        "number of particles": scene.num_particles,
        "supports": [
            [str(s.given), s.component, _text(s.value), _text(s.velocity), _text(s.between)]
            for s in supports.all
        ]
        + [["wall", w.edge, w.friction, w.separates] for w in supports.walls],
        "loads": [
            list(map(float, scene.loads.gravity)),
            *([t.edge, *map(_text, t.value), _text(t.between)] for t in scene.loads.tractions),
            *(hashlib.sha256(f.force.tobytes()).hexdigest() for f in scene.loads.forces),
        ],
        "motion": None
        if motion is None
        else [motion.gamma, _text(motion.damping), str(motion.transfer)],
    }
    sizes = {"stress": scene.attached.newton.stiffest} | dict.fromkeys(LENGTHS, grid.h)
    for array, values in placement.gathered(grid, scene.particles).items():
        size = sizes.get(array, 1.0)
        facts[f"'{array}' of the particles at its start"] = _fingerprint(values, size)
    known: dict[str, Any] = json.loads(json.dumps(facts))
    return known


def _fingerprint(values: Any, size: float) -> float:
    """A number that others than these values hardly have. It is compared to `checkpoint.ALIKE` of
    itself: round-off in them, and in values that are nothing but round-off of `size`, is no more.
    """
    weights = np.random.default_rng(0).uniform(0.5, 1.5, values.shape)
    least = values.size * ROUND_OFF * size / archive.ALIKE
    return float((weights * values + 2 * np.abs(values)).sum() + least)


def _text(value: Any) -> str:
    """A number, or that it is a function: what a function gives cannot be compared."""
    return "a function" if callable(value) else repr(value)
