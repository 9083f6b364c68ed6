"""Changes of a body between two steps: particles that are removed, laws that are replaced.

After such a change, forces on the functions of the grid are out of balance by the difference of internal
and external forces after and before it. The scene keeps them as a load that fades like a released one:
at once in a static solve, in steps in a ramp, with the next step in a motion.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from tawami import _rust
from tawami.base import checks, ranks
from tawami.base.arrays import Array, Indices, Mask
from tawami.base.errors import InputError
from tawami.domain import fitting, locking, selection
from tawami.domain.domain import Domain
from tawami.domain.excavation import Excavation
from tawami.domain.model import Model, with_laws
from tawami.domain.selection import Where
from tawami.particles import assignment, placement
from tawami.particles.assignment import Law
from tawami.step.configuration import Configuration

#: Share of the internal forces below which what is out of balance is round-off.
ROUND_OFF = 1e-9


@dataclass(frozen=True)
class Removed:
    """Particles that were removed from a body.

    Attributes:
        number: Their numbers, ascending.
        volume: Their volume [m2].
        mass: Their mass [kg per metre depth]; NaN if the scene has no density.
        momentum: sum m v (x, y) [kg m/s per metre depth]; 0 in statics.
        kinetic, elastic: Their energy [J per metre depth].
    """

    number: Indices
    volume: float
    mass: float
    momentum: Array
    kinetic: float
    elastic: float


class Construction:
    """Changes of the body of a scene between two steps."""

    configuration: Configuration

    def remove(self, where: Where) -> Removed:
        """Remove particles, as an excavation does.

        The forces that they exerted on the other particles fade like a released load. Their weight and
        their share of the loads are removed too. `scene.left` lists them; the others keep their
        numbers. `scene.particles` is another object afterwards. A call for all ranks.

        Args:
            where: The particles, as in `load`.

        Returns:
            The removed particles.

        Raises:
            InputError: No particle, all particles, or a call from within a step; nothing has changed.
            SupportError: A support or a traction would have no particles; nothing has changed.
        """
        now = self.configuration
        now.activity.check_between_steps("remove(...)")
        return _remove(now, selection.present(now.domain, "remove(...): where", where))

    def change_material(self, where: Where, material: Law) -> None:
        """Replace the material law of particles.

        Stress and density stay. A law of the same name keeps its history variables, and a `NumpyLaw` has
        the name of its function; those of another law begin at 0. If the stress is beyond the yield
        surface of the new law, it returns to it with the next step; forces out of balance then fade like
        a released load. `scene.particles` is another object afterwards. A call for all ranks.

        Args:
            where: The particles, as in `load`.
            material: Their new law.

        Raises:
            InputError: No particle, a law that does not fit the form, or a call from within a step;
                nothing has changed.

        Warns:
            LockingWarning: As `Scene`.
        """
        now = self.configuration
        now.activity.check_between_steps("change_material(...)")
        mask = selection.present(now.domain, "change_material(...): where", where)
        _check_any(now, "change_material(...)", mask)
        _change_material(now, mask, material)


def _check_any(now: Configuration, what: str, mask: Mask) -> None:
    if not ranks.anywhere(now.model.grid.comm, mask.any()):
        raise InputError(
            f"{what}: the particles have left the body already (scene.left): expected particles that "
            "are in it"
        )


def _remove(now: Configuration, mask: Mask) -> Removed:
    """Remove particles of this rank, given a mask."""
    model, before = now.model, now.domain
    comm, particles = model.grid.comm, before.particles
    _check_any(now, "remove(...)", mask)
    if not ranks.anywhere(comm, not mask.all()):
        raise InputError("remove(...) of all particles: expected some that remain")
    moving = "velocity" in dict(particles.arrays)
    velocity = particles.carried("velocity")[mask] if moving else np.zeros((0, model.space.dim))
    mass = before.mass[mask] if model.density is not None else np.full(int(mask.sum()), np.nan)
    momentum = mass @ velocity if moving else np.zeros(model.space.dim)
    kinetic = 0.5 * mass @ (velocity**2).sum(axis=1) if moving else 0.0
    kept, gone = placement.removed(model.grid, particles, mask)
    location = placement.located(model.grid, kept.x, moving=model.moves)
    location = model.grid.window.place(location)
    after = Domain.attach(model, kept, location, now.numerics, now.stopwatch)
    excavation = Excavation(comm, kept.x, particles.x[mask])
    now.supports.check_reach(before, after, excavation)
    now.loads.check_reach(excavation)
    elastic, volume_removed = before.elastic_energy, np.asarray(particles.volume)[mask].sum()
    _replace(now, after, excavation)
    sums = ranks.sum_of(
        comm,
        np.array(
            [
                volume_removed,
                mass.sum(),
                kinetic,
                elastic - after.elastic_energy,
                *model.space.resultant(momentum),
            ]
        ),
    )
    time = now.activity.time if moving else np.nan
    now.left += [(number, x, time) for number, x in gone]
    now.removed = now.removed + sums[2:4]
    volume, total, kinetic, elastic = map(float, sums[:4])
    numbers = np.sort(np.array([number for number, _ in gone]))
    return Removed(numbers, volume, total, sums[4:], kinetic, elastic)


def _replace(now: Configuration, after: Domain, excavation: Excavation | None = None) -> None:
    """Let a scene continue with other particles or laws; a call for all ranks."""
    before, zero, first = now.domain, np.zeros(after.layout.size), now.moment(0.0)
    gravity = now.loads.acceleration(now.moment())
    now.inputs.repeat(before, now.moment(), gravity)
    forces = now.loads.at_start(before, first) - before.newton.internal(zero)
    if excavation is not None:
        now.border.excavate(excavation)
    now.border_sums.attach(after)
    fitting.fit(after, now.border)
    after.assembly.attachment.start = before.assembly.attachment.start
    now.inputs.repeat(after, now.moment(), gravity)
    internal = after.newton.internal(zero)
    forces += internal - now.loads.at_start(after, first)
    forces[after.layout.num_displacement :] = 0.0
    forces[~after.layout.active] = 0.0
    now.model, now.domain = after.model, after
    layout = after.layout
    if layout.largest(forces) > ROUND_OFF * layout.largest(internal):
        now.loads.keep_balance(forces)
    now.loads.changed()


def _change_material(now: Configuration, mask: Mask, material: Law) -> None:
    """Replace the law of particles of this rank, given a mask."""
    model, particles = now.model, now.domain.particles
    mine = particles.number[mask].min(initial=np.iinfo(np.uint32).max)
    number = int(ranks.least_of(model.grid.comm, np.array([mine]))[0])
    if not isinstance(material, Law):
        raise InputError(
            f"change_material(...): material = {checks.shown(material)}: expected a material as "
            "linear_elastic(...) makes it, or a NumpyLaw"
        )
    [new] = assignment.materials_of([material])
    laws, of, numbers = _renumbered(model, np.asarray(particles.material), mask, material)
    changed = _with_numbers(model, particles, numbers, mask, new)
    other = with_laws(model, changed, laws, of, now.numerics.assembly)
    after = Domain.attach(other, changed, now.domain.location, now.numerics, now.stopwatch)
    locking.warn_of(model.grid, model.form, new.bulk_modulus / new.shear_modulus, number)
    _replace(now, after)
    now.activity.statics += 1


def _renumbered(
    model: Model, number: Any, mask: Mask, law: Law
) -> tuple[list[Law], list[int], Any]:
    """The laws with a new one for some particles, the old number of each, and those of particles.

    A law that no particle keeps is replaced; else the new one is added.
    """
    count = len(model.given)
    sums = np.array([np.bincount(number[m], minlength=count) for m in (mask, ~mask)])
    chosen, kept = ranks.sum_of(model.grid.comm, sums)
    laws, of, numbers = list(model.given), list(range(count)), number.copy()
    for old in np.flatnonzero(chosen):
        if kept[old]:
            numbers[mask & (number == old)] = len(laws)
            laws.append(law)
            of.append(int(old))
        else:
            laws[old] = law
    return laws, of, numbers


def _with_numbers(
    model: Model,
    particles: _rust.Particles,
    numbers: Any,
    mask: Mask,
    material: _rust.Material,
) -> _rust.Particles:
    """A copy of the particles with other numbers of materials, and with the history of the new law."""
    changed = particles.select(np.arange(len(particles), dtype=np.uint32))
    changed.add_history([material])
    rows, first = changed.rows(), 0
    same = np.array([one.name == material.name for one in model.materials])
    begins = mask & ~same[particles.material]
    for name, width in placement.columns(changed):
        if name == "material":
            rows[:, first] = numbers
        elif name in changed.history_names:
            rows[begins, first] = 0.0
        first += width
    return changed.of_rows(rows)
