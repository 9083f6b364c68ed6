"""States of patches over the iterations of Newton's method, which may open, close, stick and slide."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tawami.border.contact import OPEN, ContactForces

#: Tangents in which friction may turn round only after a patch was taken as sticking.
RETURNS = 10


class ContactStates:
    """States of the patches at the last tangent of a step.

    Attributes:
        tangents: Number of tangents.
    """

    def __init__(self) -> None:
        self.tangents = self._returns = 0
        self._last: ContactForces | None = None

    def sticking(self, num_points: int) -> bool | ContactForces:
        """Patches to take as sticking, see `Contact.evaluate`.

        Args:
            num_points: Number of points that are evaluated.
        """
        if self._last is None or self._returns >= RETURNS:
            return self._last is None
        return self._last if len(self._last.x) == num_points else False

    def linearised(self, now: ContactForces) -> ContactForces:
        """Contact whose derivatives serve Newton's method best, with the same forces.

        While patches open and close, border points may be far from their places on the obstacle, whose
        bends at the wrong places lead astray.
        """
        last = self._last
        self.tangents += 1
        if last is not None:
            self._returns += now.exceeded
        settled = last is not None and np.array_equal(last.state > OPEN, now.state > OPEN)
        self._last = replace(now, bends=settled)
        return self._last
