"""Attributes that a scene does not have, each with the switch that adds it."""

from __future__ import annotations

from typing import Any, NoReturn

from tawami.base.errors import NotModelledError

INERTIA = (
    "a scene by itself is static: expected motion = Dynamics(scene, velocity=...), which has it and "
    "needs Scene(..., density=...)"
)
HISTORY = (
    "a history variable of plastic laws, as von_mises(...), mohr_coulomb(...) or cam_clay(...): "
    "expected scene.particles.history('plastic_strain')"
)
GRADIENT = (
    "expected the unit tensor plus scene.particles.displacement_gradient, which particles have at "
    "finite strain, as with form='u_epsv_finite'"
)


class Absent:
    """An attribute that is not modelled; using it raises an error that names the switch.

    Args:
        reason: Reason why it is absent, and the switch that adds it.
    """

    def __init__(self, reason: str) -> None:
        self.reason, self.name = reason, ""

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    def __get__(self, instance: object, owner: type | None = None) -> Any:
        if instance is None:
            return self
        self._refuse()

    def __set__(self, instance: object, value: object) -> None:
        self._refuse()

    def _refuse(self) -> NoReturn:
        raise NotModelledError(f"{self.name}: {self.reason}")


class Elsewhere:
    """Attributes that neither a scene nor its solutions have, whatever they model."""

    velocity = Absent(INERTIA)
    acceleration = Absent(INERTIA)
    energies = Absent(INERTIA)
    plastic_strain = Absent(HISTORY)
    deformation_gradient = Absent(GRADIENT)
