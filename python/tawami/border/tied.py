"""Supports of a border off the lines of the grid: means over patches are held.

On a patch, for each held direction d (points x dim), with areas w and the prescribed displacement g:

    error    e = mean of d . (u - g)
    forces   f = -w (lambda + r e) d       on each point
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from tawami.base.arrays import Array
from tawami.base.checks import choice
from tawami.base.space import Space
from tawami.border.patches import Patches
from tawami.border.rigid import generators

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
    (turn,) = generators(space.dim)  # in the plane; a surface in space has two tangents
    along = {NORMAL: normals, TANGENT: normals @ turn.T}
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
    """A part of a border whose displacement is held in some directions, in the mean of each patch.

    A displacement that agrees with the prescribed one at the points causes no forces, and the forces
    are the same for all points of a patch, so the patch test is fulfilled.

    Attributes:
        patches: Patches of the points.
        weights: Area of each point [m2]: its length in plane strain.
        directions: Held unit vectors, directions x points x dim.
        penalty: r of each patch [Pa/m], about 200 mu / h.
    """

    patches: Patches
    weights: Array
    directions: Array
    penalty: Array

    def zero(self) -> Array:
        """Multipliers at the start [Pa], patches x directions."""
        return np.zeros((self.patches.count, len(self.directions)))

    def error(self, u: Array, prescribed: Array) -> Array:
        """Mean of the displacement minus the prescribed one [m], patches x directions.

        Args:
            u: Displacements of the points [m], points x dim.
            prescribed: Prescribed displacements along each direction [m], points x directions.
        """
        along = np.einsum("kja,ja->jk", self.directions, u)
        return self.patches.means(self.weights, along - prescribed)

    def multipliers(self, u: Array, prescribed: Array, held: Array) -> Array:
        """lambda + r e [Pa], patches x directions: the multipliers of the next augmented pass.

        Their negative values are the tractions of the support on the body along the directions.

        Args:
            u: Displacements of the points [m], points x dim.
            prescribed: Prescribed displacements along each direction [m], points x directions.
            held: Multipliers of this pass [Pa], patches x directions.
        """
        return np.asarray(held + self.penalty[:, None] * self.error(u, prescribed))

    def forces(self, u: Array, prescribed: Array, held: Array) -> Array:
        """Forces of the support on the points [N per m], points x dim.

        Args:
            u: Displacements of the points [m], points x dim.
            prescribed: Prescribed displacements along each direction [m], points x directions.
            held: Multipliers [Pa], patches x directions.
        """
        along = self.multipliers(u, prescribed, held)[self.patches.number]
        forces = np.einsum("jk,kja->ja", along, self.directions)
        return np.asarray(-self.weights[:, None] * forces)

    def stiffness(self) -> sp.csr_matrix:
        """Minus the derivative of the forces by the displacements: symmetric, not negative."""
        sizes = self.patches.sums(self.weights)
        root = np.sqrt(self.penalty / sizes)
        num, dim = self.directions.shape[1:]
        rows = np.repeat(self.patches.number, dim)
        total = sp.csr_matrix((num * dim, num * dim))
        for direction in self.directions:
            values = (self.weights * root[self.patches.number])[:, None] * direction
            entries = (values.ravel(), (rows, np.arange(num * dim)))
            factor = sp.csr_matrix(entries, shape=(self.patches.count, num * dim))
            total = total + factor.T @ factor
        return total.tocsr()
