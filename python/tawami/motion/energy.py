"""Where the energy of a motion goes, from its start on [J per metre depth].

    kinetic + elastic + dissipated + friction + left = start + external - transfer - impact - integration

all of them measured but the last, which is what the balance leaves: the error of the time integration,
and what the stabilisation of the form stores and takes (1/2 alpha h^2 sum V K^2/mu |grad eps_v|^2).
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

from tawami.base.errors import EnergyWarning

#: Share of the most energy that a body had, from which a warning tells of what nothing gave it.
GROWN = 0.05


@dataclass
class Energies:
    """A balance of energy.

    Attributes:
        kinetic: 1/2 sum m v^2 of the particles, without that of their affine fields.
        elastic: Stored by the laws.
        dissipated: Work of the stress on plastic strains.
        friction: Lost to the friction of walls.
        external: Work of loads and of supports that move.
        transfer: Kinetic energy lost on the way from the particles to the grid and back.
        impact: Kinetic energy lost where supports stop the grid.
        left: Kinetic and elastic energy of the particles that left the grid.
        integration: The rest.
    """

    kinetic: float = 0.0
    elastic: float = 0.0
    dissipated: float = 0.0
    friction: float = 0.0
    external: float = 0.0
    transfer: float = 0.0
    impact: float = 0.0
    left: float = 0.0
    integration: float = 0.0

    def __str__(self) -> str:
        return ", ".join(f"{f.name} {getattr(self, f.name):.4g}" for f in fields(self)) + " J/m"


class Growth:
    """Warns, once, of a body with more energy than it was given.

    Args:
        energy: That it has at the start [J per metre depth].
    """

    def __init__(self, energy: float) -> None:
        self._given = self._most = energy
        self._warned = False

    def state(self) -> dict[str, Any]:
        """What it was given, the most it had, and whether it has warned."""
        return dict(vars(self))

    def restore(self, state: Mapping[str, Any]) -> None:
        """The reverse of :meth:`state`."""
        vars(self).update(state)

    def given(self, energy: float) -> None:
        """It gets this much from outside the balance."""
        self._given += energy

    def look(self, energies: Energies, steps: int, time: float) -> None:
        """At the end of a step.

        Args:
            energies: The balance.
            steps: Steps so far.
            time: [s]
        """
        has = energies.kinetic + energies.elastic
        self._most = max(self._most, has)
        grown = has - self._given - energies.external
        if self._warned or not grown > GROWN * self._most:
            return
        self._warned = True
        warnings.warn(
            f"after {steps} steps, at {time:g} s, the body has {grown:.3g} J/m more energy than it was "
            f"given, {100 * grown / self._most:.2g} % of the most it had: its stress is not to be "
            "trusted. Take shorter steps or more particles; motion.energies is the balance",
            EnergyWarning,
            stacklevel=6,
        )
