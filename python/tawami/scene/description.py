"""The header of a run: what a scene models, what it does not, and the switches that add it."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from tawami.base import ranks
from tawami.base.text import labelled, size
from tawami.conditions.constraints import num_free
from tawami.form.kinematics import STRAIN_MEASURES
from tawami.step.configuration import Configuration


def header(now: Configuration, motion: str = "") -> str:
    """Lines for the start of a run; a call for all ranks.

    Args:
        now: The scene's configuration.
        motion: The line of its motion, if it has one.
    """
    return "\n".join(labelled(label, text) for label, text in lines(now, motion).items())


def lines(now: Configuration, motion: str = "") -> dict[str, str]:
    """Texts of :func:`header` by their labels."""
    found = {
        "grid": _grid(now),
        "particles": _particles(now),
        "unknowns": _unknowns(now),
        "models": ", ".join(_models(now, motion)),
        "form": now.model.form_line,
        "supports": now.supports.line,
        "obstacles": now.obstacles.line,
        "loads": now.loads.line,
        "motion": motion,
        "solver": _solver(now),
        "not modelled": "; ".join(_not_modelled(now, motion)),
    }
    return {label: text for label, text in found.items() if text}


def _grid(now: Configuration) -> str:
    domain, grid = now.domain, now.model.grid
    filled = int(np.count_nonzero(domain.active.ravel() & grid.window.own))
    filled = ranks.total(grid.comm, filled)
    return f"{now.model.grid.line}, {filled} with particles; basis {now.model.basis}"


def _particles(now: Configuration) -> str:
    particles = now.domain.particles
    number = ranks.total(now.model.grid.comm, len(particles))
    each = particles.bytes_per_particle
    arrays = ", ".join(f"{name} {width}" for name, width in particles.arrays)
    gone = f" ({len(now.left)} have left)" if now.left else ""
    return (
        f"{number}{gone}, {each} bytes each ({arrays}), {size(number * each)} in total; during a step "
        f"{now.domain.responses.bytes_per_particle} more bytes each, for the responses of the laws"
    )


def _unknowns(now: Configuration) -> str:
    layout = now.domain.layout
    mine = layout.active & layout.own
    counts = np.array([np.count_nonzero(mine[place.slice]) for place in layout.fields.values()])
    counts = ranks.sum_of(now.model.grid.comm, counts)
    numbers = dict(zip(layout.fields, counts.tolist(), strict=True))
    fields = ", ".join(f"{n} of {name}" for name, n in numbers.items())
    free = num_free(now.supports, now.domain)
    return f"{free}: {fields}, minus {sum(numbers.values()) - free} prescribed by supports"


def _solver(now: Configuration) -> str:
    method = now.domain.newton.method(num_free(now.supports, now.domain))
    return now.numerics.line(method, now.model.grid.comm.size)


def _models(now: Configuration, motion: str) -> Iterator[str]:
    carried = "velocity" in dict(now.domain.particles.arrays)
    statics = "statics between the steps of a motion" if carried else "statics"
    yield "inertia" if motion else statics
    yield now.model.form.strain.description
    yield f"laws {', '.join(dict.fromkeys(now.model.laws))}"


def _not_modelled(now: Configuration, motion: str) -> Iterator[str]:
    """Each thing that is not modelled, with the switch that adds it."""
    model, form = now.model, now.model.form
    if not motion:
        density = " with Scene(..., density=...)" if model.density is None else ""
        yield f"inertia (Dynamics(scene){density})"
    if not form.strain.finite:
        yield f"finite strain (form='{STRAIN_MEASURES['finite'].mixed_form}')"
    if model.without_history.all():
        yield "plasticity (von_mises(...), drucker_prager(...), mohr_coulomb(...), cam_clay(...))"
    if form.volume_field is None:
        yield f"a field for the volume (form='{form.strain.mixed_form}')"
    if model.options.get("ghost_penalty") == "off":
        yield "ghost penalty (ghost_penalty='on')"
    if not now.supports.walls and not now.obstacles.all:
        yield "contact (scene.wall(...), scene.obstacle(...))"
    if not now.loads.gravity.any():
        density = ", Scene(..., density=...)" if model.density is None else ""
        yield f"weight (scene.gravity(...){density})"
