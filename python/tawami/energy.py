"""Where the energy of a motion goes, from its start on [J per metre depth].

    kinetic + elastic + dissipated + friction + left = start + external - transfer - impact - integration

all of them measured but the last, which is what the balance leaves: the error of the time integration,
and what the stabilisation of the form stores and takes (1/2 alpha h^2 sum V K^2/mu |grad eps_v|^2).
"""

from __future__ import annotations

from dataclasses import dataclass, fields


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
