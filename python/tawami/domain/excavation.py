"""The part of a border that stays where particles are removed."""

from __future__ import annotations

from typing import Any

import numpy as np

from tawami.base import ranks
from tawami.base.arrays import Array, Indices

#: Share of a stretch of the border that is round-off.
SAME = 1e-9


class Excavation:
    """Particles that are removed from a body, and those that stay.

    A place on the border stays if the nearest particle stays. The border ends half way between a
    particle that stays and one that does not, and the error of its length is at most half of their
    distance.

    Args:
        comm: The communicator of the grid.
        stay, gone: Positions of particles of this rank [m], particles x dim.
    """

    def __init__(self, comm: Any, stay: Array, gone: Array) -> None:
        from scipy.spatial import KDTree  # takes long to import

        self._comm = comm
        self._trees = [KDTree(x) if len(x) else None for x in (np.array(stay), np.array(gone))]

    def parts(self, samples: Array) -> tuple[Indices, Array, Array]:
        """The parts of stretches that stay; a call for all ranks.

        Args:
            samples: Positions [m] at equal distances along each, stretches x samples x dim.

        Returns:
            The stretch of each part, and the shares of its length, 0 to 1, at which the part starts
            and ends.
        """
        n, count, dim = samples.shape
        stay, gone = (
            np.full(n * count, np.inf) if tree is None else tree.query(samples.reshape(-1, dim))[0]
            for tree in self._trees
        )
        # linear along a straight line while the two nearest particles are the same
        w = ranks.least_of(self._comm, gone) ** 2 - ranks.least_of(self._comm, stay) ** 2
        a, b = w.reshape(n, count)[:, :-1], w.reshape(n, count)[:, 1:]
        change = np.divide(a, a - b, out=np.zeros_like(a), where=(a < 0) != (b < 0))
        low = np.where(a < 0, np.where(b < 0, 1.0, change), 0.0)
        high = np.where((b < 0) & (a >= 0), change, 1.0)
        of, k = np.nonzero(high - low > SAME)
        shares = np.stack([(k + side[of, k]) / (count - 1) for side in (low, high)])
        joined = (of[1:] == of[:-1]) & (shares[0, 1:] - shares[1, :-1] < SAME)
        first, last = np.append(True, ~joined)[: len(of)], np.append(~joined, True)[: len(of)]
        low, high = shares[0, first], shares[1, last]
        return of[first], np.where(low < SAME, 0.0, low), np.where(high > 1 - SAME, 1.0, high)
