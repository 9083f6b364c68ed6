"""Supports of a border off the lines of the grid: means over patches are held.

On a patch, for a held direction d of each point, with areas w and the prescribed displacement g:

    error    e = mean of d . u - g
    forces   f = -w (lambda + r e) d       on each point
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from tawami.base.arrays import Array, Indices
from tawami.base.checks import choice
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


@dataclass(frozen=True)
class Tied:
    """A part of a border whose displacement is held in the mean of each patch.

    A displacement that agrees with the prescribed one at the points causes no forces, and the forces
    are the same for all points of a patch, so the patch test is fulfilled.

    Attributes:
        means: Mean of the held component over each patch, of all unknowns, patches x unknowns.
        areas: Area of each patch [m2]: its length in plane strain.
        penalty: r of each patch [Pa/m], about 200 mu / h.
    """

    means: sp.csr_matrix
    areas: Array
    penalty: Array

    def multipliers(self, error: Array, held: Array) -> Array:
        """lambda + r e [Pa] of each patch: the multipliers of the next augmented pass.

        Their negative values are the tractions of the support on the body along the directions.

        Args:
            error: Mean of the displacement minus the prescribed one [m].
            held: Multipliers of this pass [Pa].
        """
        return np.asarray(held + self.penalty * error)

    def forces(self, multipliers: Array) -> Array:
        """Forces of the support on all unknowns [N per metre depth]."""
        return np.asarray(-(self._transposed @ (self.areas * multipliers)))

    @cached_property
    def _transposed(self) -> sp.csc_matrix:
        return self.means.T

    @cached_property
    def stiffness(self) -> sp.csr_matrix:
        """Minus the derivative of the forces by the unknowns: symmetric, not negative."""
        weighted = sp.diags(self.areas * self.penalty) @ self.means
        return (self._transposed @ weighted).tocsr()


def means(
    patches: Patches, weights: Array, functions: Array, places: Indices, size: int
) -> sp.csr_matrix:
    """Means over patches of a sum of unknowns at their points, patches x unknowns.

    Args:
        patches: Patches of the points.
        weights: Area of each point [m2].
        functions: Factors of the unknowns at each point, points x functions.
        places: Numbers of these unknowns, points x functions.
        size: Number of all unknowns.
    """
    point, function = functions.nonzero()
    values = patches.shares(weights)[point] * functions[point, function]
    entries = (values, (patches.number[point], places[point, function]))
    return sp.csr_matrix(entries, shape=(patches.count, size))
