"""What a scene models and what it does not, in words; and what asking for the rest gives.

A scene has the arrays, kernels and terms that it needs. The header of a run names them, and for what
is not there the switch that adds it; an attribute that is not there raises the same sentence.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np

from tawami.base import ranks
from tawami.base.errors import NotModelledError
from tawami.form.kinematics import STRAIN_MEASURES
from tawami.motion.transfer import TRANSFERS

if TYPE_CHECKING:
    from tawami.motion.dynamics import Dynamics
    from tawami.scene.scene import Scene
    from tawami.scene.supports import Support

WIDTH, LABEL = 100, 13
#: Names that a line lists before it counts the rest.
MOST = 6
INERTIA = (
    "a scene by itself is static: expected motion = Dynamics(scene, velocity=...), which has it and "
    "needs Scene(..., density=...)"
)
HISTORY = (
    "a history variable of plastic laws, as von_mises(...), drucker_prager(...) or mohr_coulomb(...): "
    "expected scene.particles.history('plastic_strain')"
)
GRADIENT = (
    "no form stores it. At finite strain, as with form='u_epsv_finite', the stress tells the elastic "
    "part of it, and positions and displacements the motion"
)


class Absent:
    """An attribute that is not modelled there; asking for it raises the sentence that says what does.

    Args:
        sentence: Why it is not there, and which switch models it.
    """

    def __init__(self, sentence: str) -> None:
        self.sentence, self.name = sentence, ""

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    def __get__(self, instance: object, owner: type | None = None) -> Any:
        if instance is None:
            return self
        self._refuse()

    def __set__(self, instance: object, value: object) -> None:
        self._refuse()

    def _refuse(self) -> NoReturn:
        raise NotModelledError(f"{self.name}: {self.sentence}")


class Elsewhere:
    """What a scene and its solutions do not hold, whatever they model."""

    velocity = Absent(INERTIA)
    acceleration = Absent(INERTIA)
    energies = Absent(INERTIA)
    plastic_strain = Absent(HISTORY)
    deformation_gradient = Absent(GRADIENT)


def header(scene: Scene, motion: Dynamics | None = None) -> str:
    """Lines for the start of a run; a call for all ranks.

    Args:
        scene: The scene.
        motion: Its motion, if there is one.
    """
    lines = {
        "grid": _grid(scene),
        "particles": _particles(scene),
        "unknowns": _unknowns(scene),
        "models": ", ".join(_models(scene, motion)),
        "form": _form(scene),
        "supports": _supports(scene),
        "loads": _loads(scene),
        "motion": _motion(scene, motion),
        "solver": _solver(scene),
        "not modelled": "; ".join(_not_modelled(scene, motion)),
    }
    return "\n".join(labelled(label, text) for label, text in lines.items() if text)


def labelled(label: str, text: str) -> str:
    """A text beside its label, in as many lines as it takes."""
    return textwrap.fill(
        f"{label:{LABEL}} {text}",
        WIDTH,
        subsequent_indent=" " * (LABEL + 1),
        break_long_words=False,
        break_on_hyphens=False,
    )


def _grid(scene: Scene) -> str:
    grid = scene.grid
    (nx, ny), (x0, y0), (x1, y1) = grid.cells, grid.origin, grid.upper
    filled = int(np.count_nonzero(scene.attached.field.active))
    return (
        f"{nx} x {ny} cells of {grid.h:g} m from ({x0:g}, {y0:g}) to ({x1:g}, {y1:g}), {filled} with "
        f"particles; basis {scene.basis}"
    )


def _particles(scene: Scene) -> str:
    particles = scene.particles
    number = int(ranks.sum_of(scene.grid.comm, np.array([len(particles)]))[0])
    each = particles.bytes_per_particle
    arrays = ", ".join(f"{name} {size}" for name, size in particles.arrays)
    gone = f" ({len(scene.left)} left the grid)" if scene.left else ""
    return (
        f"{number}{gone}, {each} bytes each ({arrays}), {_size(number * each)} in all; while a step is "
        f"solved {scene.attached.newton.bytes_per_particle} more each for what the laws answer"
    )


def _size(number: int) -> str:
    return f"{number / 1e6:.3g} MB" if number >= 1e6 else f"{number / 1e3:.3g} kB"


def _unknowns(scene: Scene) -> str:
    layout = scene.attached.layout
    parts = np.split(layout.active, [layout.num_displacement])
    numbers = [int(part.sum()) for part in parts]
    fields = ", ".join(
        f"{n} of {name}" for name, n in zip(scene.form.fields, numbers, strict=False)
    )
    taken = sum(numbers) - _free(scene)
    return f"{sum(numbers) - taken}: {fields}, less {taken} that supports take"


def _free(scene: Scene) -> int:
    """Unknowns that the present supports leave."""
    zero = np.zeros(scene.num_coefficients)

    def nothing(_: Support) -> float:
        return 0.0

    attached = scene.attached
    return scene.supports.reduction(attached, nothing, zero, zero, moving=True).size


def _models(scene: Scene, motion: Dynamics | None) -> Iterator[str]:
    carried = "velocity" in dict(scene.particles.arrays)
    statics = "statics between the steps of a motion" if carried else "statics"
    yield statics if motion is None else "inertia"
    yield scene.form.strain.description
    yield f"laws {', '.join(dict.fromkeys(scene.laws))}"


def _form(scene: Scene) -> str:
    form = scene.form
    used = [f"{name} = {value:g}" for name, value in scene.parameters.items()]
    used += [f"{name} '{choice}'" for name, choice in scene.options.items()]
    return ", ".join([f"{form.name} in {' and '.join(form.fields)}", *used])


def _supports(scene: Scene) -> str:
    supports = scene.supports
    texts = [f"{support} {'xy'[support.component]}{_given(support)}" for support in supports.all]
    texts += [f"wall(edge='{wall.edge}') friction {wall.friction:g}" for wall in supports.walls]
    return _listed(texts)


def _given(support: Support) -> str:
    if support.velocity is not None:
        return " with a velocity"
    if support.still:
        return ""
    return " by a function" if callable(support.value) else f" = {support.value:g} m"


def _loads(scene: Scene) -> str:
    loads = scene.loads
    texts = []
    if loads.gravity.any():
        texts.append(f"gravity ({loads.gravity[0]:g}, {loads.gravity[1]:g}) m/s2")
    texts += [f"traction(edge='{traction.edge}')" for traction in loads.tractions]
    for forces in loads.forces:
        texts.append(f"force on {np.count_nonzero(forces.force.any(axis=1))} particles")
    return _listed(texts)


def _listed(texts: Sequence[str]) -> str:
    """The first few of them, and how many others there are."""
    if not texts:
        return "none"
    more = [f"{len(texts) - MOST} others"] if len(texts) > MOST else []
    return ", ".join([*texts[:MOST], *more])


def _motion(scene: Scene, motion: Dynamics | None) -> str:
    if motion is None:
        return ""
    text = f"Newmark gamma {motion.gamma:g}, beta {motion.beta:g}, from {motion.time:g} s"
    if not scene.form.strain.finite:
        return f"{text}, velocities stay on the grid"
    (transfer,) = (name for name, kind in TRANSFERS.items() if kind == motion.transfer)
    damping = f"{motion.damping:g} s" if np.isfinite(motion.damping) else "none"
    return f"{text}, transfer {transfer}, damping {damping}"


def _solver(scene: Scene) -> str:
    numerics, size = scene.numerics, scene.grid.comm.size
    solver: str = numerics.linear_solver
    if solver == "direct":
        solver += f", factorised {numerics.factorise.replace('_', ' ')}"
    return (
        f"Newton to {numerics.tolerance:g} in at most {numerics.max_iterations} iterations, "
        f"{numerics.tangent_rule} tangent, {solver}, assembly {numerics.assembly}, "
        f"{size} rank{'s' if size > 1 else ''}"
    )


def _not_modelled(scene: Scene, motion: Dynamics | None) -> Iterator[str]:
    """What is not, each with the switch that adds it."""
    form = scene.form
    if motion is None:
        density = "" if scene.has_density else " with Scene(..., density=...)"
        yield f"inertia (Dynamics(scene){density})"
    if not form.strain.finite:
        yield f"finite strain (form='{STRAIN_MEASURES['finite'].mixed_form}')"
    if not scene.particles.history_names and "NumpyLaw" not in scene.laws:
        yield "plasticity (von_mises(...), drucker_prager(...), mohr_coulomb(...))"
    if len(form.fields) == 1:
        yield f"a field for the volume (form='{form.strain.mixed_form}')"
    if scene.options.get("ghost_penalty") == "off":
        yield "ghost penalty (ghost_penalty='on')"
    if not scene.supports.walls:
        yield "contact (scene.wall(...))"
    if not scene.loads.gravity.any():
        density = "" if scene.has_density else ", Scene(..., density=...)"
        yield f"weight (scene.gravity(...){density})"
