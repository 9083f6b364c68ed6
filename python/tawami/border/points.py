"""Points on the border of a body, with the lengths that they integrate over."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from tawami.base.arrays import Array, Indices


def transformed(area: Array, f: Array) -> Array:
    """Outward normals times areas after a deformation (Nanson: n dA = cof(f) n0 dA0).

    Args:
        area: The same before, points x dim.
        f: Deformation gradient at each point, points x dim x dim.
    """
    if f.shape[1] == 2:  # cof(F) = tr(F) 1 - F^T
        trace = f[:, 0, 0] + f[:, 1, 1]
        return np.asarray(trace[:, None] * area - np.matmul(area[:, None], f)[:, 0])
    inverse = np.linalg.inv(f)
    return np.asarray(np.linalg.det(f)[:, None] * np.einsum("pji,pj->pi", inverse, area))


@dataclass(frozen=True)
class BorderPoints:
    """Points on a border, which integrate over it; they have no mass and no stress.

    Points of one chain follow one another along the border without a corner.

    Attributes:
        x: Positions [m], points x dim.
        length: Length of the border [m] that each integrates over, in the plane of the grid.
        normal: Outward unit normals, points x dim.
        tag: Number of the name of each among `names`.
        names: Names of the parts of the border.
        chain: Number of the chain of each.
        along: Distance of each along its chain [m].
    """

    x: Array
    length: Array
    normal: Array
    tag: Indices
    names: tuple[str, ...]
    chain: Indices
    along: Array

    def __len__(self) -> int:
        return len(self.x)

    def __getitem__(self, chosen: Any) -> BorderPoints:
        """Some of the points."""
        arrays = (self.x, self.length, self.normal, self.tag)
        x, length, normal, tag = (np.asarray(array[chosen]) for array in arrays)
        return BorderPoints(
            x, length, normal, tag, self.names, self.chain[chosen], self.along[chosen]
        )
