"""Points that integrate over parts of cells: the rules of full cells and of triangles.

In this room lengths are in cells from the origin of the grid until a `Body` is made, and a cell is
given by its number (x fastest).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from tawami import _rust
from tawami.base.arrays import Array, Indices, Mask
from tawami.base.space import lattice, tensor_product
from tawami.fem import rules

#: Degree of the rule on the triangles of a cut cell: grad w : C : grad u of quadratic splines.
DEGREE = 6
#: A part of a cell this small, or this share of a body smaller than a cell, is round-off.
ROUND_OFF = 1e-12


@dataclass(frozen=True)
class Points:
    """Points with weights.

    Attributes:
        x: Positions [cells], n x 2.
        weight: Areas [cells^2], n. Negative ones are subtracted.
        cell: Number of the cell of each point, n.
        material: Number of the material of each point, n.
    """

    x: Array
    weight: Array
    cell: Indices
    material: Indices

    def __getitem__(self, chosen: Mask | Indices | slice) -> Points:
        """Some of the points."""
        return Points(self.x[chosen], self.weight[chosen], self.cell[chosen], self.material[chosen])


def joined(parts: Sequence[Points]) -> Points:
    """The points of all parts, one part after another."""
    return Points(
        *(np.concatenate([getattr(part, f.name) for part in parts]) for f in fields(Points))
    )


def areas(triangles: Array) -> Array:
    """Areas of triangles (n x 3 x 2), positive if their corners are counter-clockwise."""
    a, b = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    return np.asarray(0.5 * (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]))


def halves(corner: Array | Indices, size: float = 1.0) -> Array:
    """Two triangles for each square, counter-clockwise, n x 2 x 3 x 2, given its lower left corner."""
    triangles = np.array([[[0, 0], [1, 0], [1, 1]], [[0, 0], [1, 1], [0, 1]]], dtype=float)
    return np.asarray(corner[:, None, None] + size * triangles)


def in_boxes(lower: Array, upper: Array, cell: Indices) -> Points:
    """Gauss points of boxes between two corners (n x dim), each in one cell."""
    along, weights = _rust.gauss(DEGREE // 2 + 1)
    dim = lower.shape[1]
    size, unit = upper - lower, lattice([along] * dim)
    return Points(
        (lower[:, None] + size[:, None] * unit).reshape(-1, dim),
        np.outer(size.prod(axis=1), tensor_product([weights] * dim)).ravel(),
        np.repeat(cell, len(unit)),
        np.repeat(np.zeros_like(cell), len(unit)),
    )


def in_triangles(corners: Array, cell: Indices, material: Indices | None = None) -> Points:
    """Gauss points of triangles (n x 3 x 2) of either orientation, each triangle in one cell."""
    points, weights = rules.triangle_rule(DEGREE)
    barycentric = np.column_stack([1 - points.sum(axis=1), points])
    return Points(
        (barycentric @ corners).reshape(-1, 2),
        np.outer(np.abs(areas(corners)), 2 * weights).ravel(),
        np.repeat(cell, len(weights)),
        np.repeat(np.zeros_like(cell) if material is None else material, len(weights)),
    )
