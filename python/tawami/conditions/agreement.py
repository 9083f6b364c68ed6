"""Supports on patches that overlap: those that agree hold each place of the border once."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import combinations

import numpy as np

from tawami.base.arrays import Array, Mask
from tawami.base.errors import SupportError
from tawami.base.text import listed
from tawami.conditions import step_values
from tawami.conditions.action import Term
from tawami.conditions.held_border import HeldBorder
from tawami.conditions.support import Support
from tawami.domain.moving_points import MovingPoints

#: Difference of values that is round-off, relative to the largest, and of directions that are alike.
ROUND_OFF, ALIKE = 1e-9, 1e-6
#: Share of the length of a point within which its place is surely the same part of the border: Gauss
#: points lie at 0.396 of their length from the end of a piece at least.
NEAR = 0.39
#: Distance of two consecutive points relative to the mean of their lengths: 1.07 at most in Gauss rules.
APART = 1.08


def others_hold(
    support: Support, others: Sequence[HeldBorder], amount: Callable[[Term], float]
) -> Mask:
    """Mask of the points of a support that others hold already in its direction, alone or together.

    Args:
        support: The support.
        others: Those before it.
        amount: Factor of each value.

    Raises:
        SupportError: Others prescribe another value there.
    """
    place = support.place
    assert isinstance(place, MovingPoints)
    x, normals = place.x, place.normal
    direction, none = support.directions(normals), np.zeros(len(x), dtype=bool)
    alike = [other for other in others if other.support.of_field == support.of_field]
    along = [(direction * other.support.directions(normals)).sum(axis=1) for other in alike]
    if not np.any(along):  # no sum of theirs has this direction
        return none
    masks = {other.support: support.weak & _covered(x, other) for other in alike}
    near = [other for other, mask in masks.items() if mask.any()]
    if not near:
        return none
    covered = np.stack([masks[other] for other in near], axis=1)
    known = np.stack([other.directions(normals) for other in near], axis=1) * covered[..., None]
    # the direction as a sum of those of the others
    shares = np.einsum("ja,jak->jk", direction, np.linalg.pinv(known, rcond=ALIKE))
    rest = np.abs(np.einsum("jk,jka->ja", shares, known) - direction).max(axis=1)
    found: Mask = covered.any(axis=1) & (rest <= ALIKE)
    values = np.stack([step_values.at_points(other, amount, x) for other in near], axis=1)
    theirs = (shares * values).sum(axis=1)[found]
    mine = step_values.at_points(support, amount, x)[found]
    change = float(np.abs(theirs - mine).max(initial=0.0))
    if change > ROUND_OFF * max(np.abs(values).max(), np.abs(mine).max(initial=0.0)):
        names = listed([other.line for other in near])
        raise SupportError(
            f"{names} and {support.line} prescribe values of '{support.axis}' that differ by "
            f"{change:.3g} {support.unit} where they meet: expected supports that agree; change or "
            "release one"
        )
    return found


def _covered(x: Array, held: HeldBorder) -> Mask:
    """Mask of positions on the part of the border that a support holds."""
    from scipy.spatial import KDTree  # takes long to import

    count = min(3, len(held.x))
    distance, near = KDTree(held.x).query(x, k=[*range(1, count + 1)])
    length, to = held.length[near], held.x[near] - x[:, None]
    mask: Mask = distance[:, 0] <= NEAR * length[:, 0]
    for a, b in combinations(range(count), 2):
        between = (to[:, a] * to[:, b]).sum(axis=1) < 0
        gap = np.linalg.norm(to[:, a] - to[:, b], axis=1)
        mask |= between & (gap <= APART * (length[:, a] + length[:, b]) / 2)
    return mask
