"""A body as its particles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from tawami.base.arrays import Array


@dataclass(frozen=True)
class Body:
    """Positions and volumes of the particles of a body.

    Attributes:
        x: Positions [m], particles x 2.
        volume: Volumes per metre depth [m2], one per particle.
        material_of: Number of the material of each particle. None: all have the first material.
        names: Names of the materials, in the order of their numbers. Empty: they have no names.
    """

    x: Array
    volume: Array
    material_of: npt.NDArray[np.uint32] | None = None
    names: tuple[str, ...] = ()

    def __repr__(self) -> str:
        materials = f", materials {', '.join(self.names)}" if self.names else ""
        return (
            f"Body({len(self.x)} particles, {np.sum(self.volume):g} m2 per metre depth{materials})"
        )
