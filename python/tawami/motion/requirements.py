"""Requirements of a motion: of its scene, of prescribed displacements, and of its damping."""

from __future__ import annotations

import numpy as np

from tawami.base import checks
from tawami.base.errors import InputError
from tawami.conditions.obstacle import Obstacle
from tawami.conditions.support import Support
from tawami.motion.transfer import Transfer
from tawami.scene.scene import Scene
from tawami.step.configuration import Configuration


def check_displacements(now: Configuration) -> None:
    """Check that the body has the displacements that supports prescribe at the present time."""
    for obstacle in now.obstacles.all:
        names = np.array(obstacle.motions)[obstacle.free & ~(obstacle.mass > 0)]
        if len(names):
            argument = "inertia" if names[0] not in now.model.space.axes else "mass"
            raise InputError(
                f"{obstacle}: its motion '{names[0]}' is free and has no mass, which Dynamics needs: "
                f"expected scene.obstacle(..., {argument}=...)"
            )
    actions: list[Support | Obstacle] = [*now.supports.all, *now.obstacles.all]
    for support in actions:
        if support.is_ahead(now.moment()):
            raise InputError(
                f"{support} prescribes a displacement that the body does not have yet: expected "
                "fix(..., velocity=...) or an amplitude that is 0 at first for a motion, or "
                "ramp(scene) before Dynamics"
            )


def check_scene(scene: Scene) -> None:
    """Check that a scene can be set in motion."""
    model = scene.configuration.model
    if model.density is None:
        raise InputError("Dynamics needs Scene(..., density=...) [kg/m3]")
    if scene.basis == "biquadratic":
        raise InputError(
            "Dynamics with the basis 'biquadratic': its lumped masses are not all positive; use "
            "'quadratic_spline'"
        )
    if not model.least_density > 0:
        raise InputError("Dynamics: a density of 0: expected more than 0 kg/m3 for every material")


def checked_damping(damping: float, transfer: Transfer, *, moves: bool) -> float:
    """The time of damping, checked."""
    expected = "a time in s, more than 0"
    damping = checks.real("damping", damping, expected)
    if not damping > 0:
        raise InputError(f"damping = {damping!r}: expected {expected}")
    if damping != np.inf and not (transfer.flip and moves):
        raise InputError(
            f"damping = {damping:g} s relaxes the velocities of FLIP: expected transfer 'affine_flip' "
            "or 'flip' and a form of finite strain; gamma > 0.5 damps too"
        )
    return damping
