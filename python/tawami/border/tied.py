"""Supports of a border off the lines of the grid: held directions, and means over patches."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tawami.base.arrays import Array, Indices
from tawami.base.checks import choice
from tawami.base.rows import Rows
from tawami.base.space import Space
from tawami.border.curves import left
from tawami.border.patches import Patches

#: Names of directions that follow the border.
NORMAL, TANGENT = "normal", "tangent"


def directions(space: Space, components: Sequence[str], normals: Array) -> Array:
    """Unit vectors of held components, components x points x dim.

    Args:
        space: The space, which names the axes.
        components: Names of axes, "normal" or "tangent"; the tangent has the body on its left.
        normals: Outward normals of the points, points x dim.

    Raises:
        InputError: Another name.
    """
    along = {NORMAL: normals, TANGENT: left(normals)}  # a surface in space has two tangents
    known = (*space.axes, *along)
    vectors = [
        along[name]
        if name in along
        else np.tile(np.eye(space.dim)[space.axis(name)], (len(normals), 1))
        for name in (choice("component", given, known) for given in components)
    ]
    return np.stack(vectors)


def means(
    patches: Patches, weights: Array, some: Indices, functions: Array, places: Indices, size: int
) -> Rows:
    """Part of some points in means over patches of sums of unknowns at points, patches x unknowns.

    Args:
        patches: Patches of the points.
        weights: Area of each point [m2].
        some: Numbers of the points that count.
        functions: Factors of the unknowns at each of them, points x functions.
        places: Numbers of these unknowns, points x functions.
        size: Number of all unknowns.
    """
    point, function = functions.nonzero()
    values = patches.shares(weights)[some[point]] * functions[point, function]
    place = patches.number[some[point]], places[point, function]
    return Rows.of(*place, values, (patches.count, size))
