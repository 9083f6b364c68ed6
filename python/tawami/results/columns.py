"""Columns of tables, by name: energies, reactions, displacements of points, momentum, iterations."""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, fields

import numpy as np

from tawami import _rust
from tawami.base import checks, ranks
from tawami.base.arrays import Array, of_components
from tawami.base.errors import InputError, NotModelledError
from tawami.base.text import meant
from tawami.domain.points import check_in_body
from tawami.grid import edges
from tawami.motion.energy import Energies
from tawami.motion.observer import Motion, Snapshot, Subject
from tawami.particles.placement import in_order
from tawami.quantities.quantities import local_arrays
from tawami.scene.scene import Scene
from tawami.step.reactions import check_supported

#: Particles that a linear fit of displacements around a point uses at finite strain.
NEIGHBOURS = 12
#: Difference of distances that is round-off [cells].
ROUND_OFF = 1e-6


@dataclass(frozen=True)
class Columns:
    """One quantity, in one column or several.

    Attributes:
        labels: Their names and units.
        of: Their values, from a snapshot and the step size before it; a call for all ranks.
    """

    labels: tuple[str, ...]
    of: Callable[[Snapshot, float], Sequence[float]]


#: Names of quantities, as messages list them.
KNOWN = (
    "energies", "momentum", "angular momentum", "reaction EDGE", "reaction (X, Y)",
    "displacement (X, Y)", "run-out", "particles", "Newton iterations", "step size",
)  # fmt: skip


def columns(names: Iterable[str], subject: Subject) -> list[Columns]:
    """Columns by the names of quantities.

    Raises:
        NotModelledError: One that the scene does not have; the message names the switch that adds it.
        InputError: An unknown name, a point outside the grid, an edge without a support.
    """
    return [_columns(name, subject) for name in names]


def usual_columns(subject: Subject) -> tuple[str, ...]:
    """Columns of a table without names."""
    return (
        *(("energies",) if subject.motion is not None else ()),
        "Newton iterations",
        "step size",
    )


def _columns(name: str, subject: Subject) -> Columns:
    if name == "energies":
        names = [field.name for field in fields(Energies)]
        unit = subject.scene.grid.space.short("J")
        labels = tuple(f"energy {part} [{unit}]" for part in names)
        _ = getattr(subject, name)  # or the error of the scene that has none
        return Columns(labels, lambda now, _: [getattr(_moving(now).energies, n) for n in names])
    if name in ("momentum", "angular momentum"):
        return _momentum(name, subject)
    if name == "run-out":
        return Columns(("run-out [m]",), lambda now, _: [_farthest(now.scene)])
    if name == "particles":
        return Columns(("particles [-]",), lambda now, _: [_present(now.scene)])
    if name == "Newton iterations":
        return Columns(("Newton iterations [-]",), lambda now, _: [_iterations(now)])
    if name == "step size":
        unit = "-" if subject.motion is None else "s"
        return Columns((f"step size [{unit}]",), lambda _, size: [size])
    kind, _, rest = name.partition(" ")
    if kind == "reaction" and rest:
        return _reaction(name, rest, subject.scene)
    if kind == "displacement" and rest:
        return _displacement(name, _point(name, rest), subject.scene)
    raise InputError(
        f"table: '{name}' is unknown: expected one of {', '.join(KNOWN)}{meant(name, KNOWN)}"
    )


def _moving(now: Snapshot) -> Motion:
    motion = now.subject.motion
    assert motion is not None
    return motion


def _momentum(name: str, subject: Subject) -> Columns:
    if subject.motion is None:
        try:
            _ = subject.scene.velocity
        except NotModelledError as error:
            raise NotModelledError(f"{name} needs a {error}") from None
    space = subject.scene.grid.space
    if name == "momentum":
        labels = tuple(f"momentum {axis} [{space.unit('kg m/s')}]" for axis in space.axes)
        return Columns(labels, lambda now, _: list(_moving(now).linear_momentum))
    if space.hoop:
        raise NotModelledError(
            "angular momentum: in axisymmetry a body does not turn; expected 'momentum'"
        )
    label = f"angular momentum [{space.unit('kg m2/s')}]"
    return Columns((label,), lambda now, _: [_moving(now).angular_momentum()])


def _farthest(scene: Scene) -> float:
    """The largest x of a particle [m]."""
    most = float(np.asarray(scene.particles.x)[:, 0].max(initial=-np.inf))
    return ranks.largest(scene.grid.comm, most)


def _present(scene: Scene) -> float:
    return float(scene.num_particles - len(scene.left))


def _iterations(now: Snapshot) -> float:
    return 0 if now.solution is None else now.solution.iterations


def _reaction(name: str, place: str, scene: Scene) -> Columns:
    at: str | tuple[float, float] = place
    if place.startswith("("):
        at = _point(name, place)
        held = scene.configuration.supports.at_points
        if not any(np.allclose(at, known) for s in held for known in s.places):
            raise InputError(f"{name}: no point is held there: expected hold({at}, ...) before")
    else:
        check_supported(place, scene.configuration.supports)

    def of(now: Snapshot, _: float) -> list[float]:
        if now.solution is None:
            return [np.nan, np.nan]  # unknown before the first step
        return list(now.solution.reaction(at))

    return Columns((f"{name} x [N/m]", f"{name} y [N/m]"), of)


def _point(name: str, text: str) -> tuple[float, float]:
    try:
        return checks.point(name, ast.literal_eval(text))
    except (SyntaxError, ValueError):
        raise InputError(f"{name}: expected a point as (2, 0) after the name") from None


def _displacement(name: str, point: tuple[float, float], scene: Scene) -> Columns:
    """Displacement of the grid; at finite strain, of the particles that were around the point."""
    location = edges.locate_point(scene.grid, point, name)
    functions, shares, _ = _rust.functions_at(location, scene.basis)
    places = of_components(functions[0], scene.grid.space.dim)
    moves = scene.form.strain.finite
    if moves:
        displacement_near(scene, point, name)
    else:
        check_in_body(scene.configuration.domain, point, name)

    def of(now: Snapshot, _: float) -> list[float]:
        if moves:
            return list(displacement_near(now.scene, point, name))
        state = now.scene.configuration
        return list(shares[0] @ state.domain.layout.at(state.before, places))

    return Columns((f"{name} x [m]", f"{name} y [m]"), of)


def displacement_near(subject: Subject, point: tuple[float, float], what: str) -> Array:
    """Displacement (u_x, u_y) [m] of a material point since the start: a linear fit to the particles
    that were around it; a call for all ranks.

    Args:
        subject: Scene or motion.
        point: Its position at the start [m].
        what: Name of the point in messages.

    Raises:
        InputError: No particle was within a cell of it.
    """
    arrays, h, comm = local_arrays(subject), subject.scene.grid.h, subject.scene.grid.comm
    u = arrays["displacement"]
    offset = arrays["x"] - u - np.asarray(point)
    distance = np.linalg.norm(offset, axis=1)
    least = np.sort(ranks.allgathered(comm, np.sort(distance)[:NEIGHBOURS]))[:NEIGHBOURS]
    if not least.min(initial=np.inf) <= h:
        raise InputError(
            f"{what}: no particle was within a cell ({h:g} m) of it: expected a point of the body "
            "at the start"
        )
    # all at the distance of the last one, so that round-off does not choose among them
    near = distance <= least[-1] + ROUND_OFF * h
    gather = in_order(comm, arrays["number"][near])
    basis = np.pad(gather(offset[near]), ((0, 0), (1, 0)), constant_values=1.0)
    return np.asarray(np.linalg.lstsq(basis, gather(u[near]), rcond=None)[0][0])
