"""How much of a load or of a prescribed displacement the body carries."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from tawami.base.errors import CheckpointError


@dataclass
class Share:
    """What grows from `carried` to `target` while a run goes from part 0 to part 1.

    Numbers, or vectors, of one kind: shares of a load from 0 to 1, or an acceleration [m/s2].

    Attributes:
        carried: What later parts grow from: the body was in equilibrium with it.
        target: What the driver script asked for.
        applied: What the last equilibrium was found for.
    """

    carried: Any = 0.0
    target: Any = 1.0
    applied: Any = 0.0

    def at(self, part: float) -> Any:
        """The value once `part` of what is new has been applied."""
        return self.carried + part * (self.target - self.carried)

    def apply(self, part: float) -> None:
        """The body is in equilibrium with this part."""
        self.applied = self.at(part)

    def accept(self, part: float) -> None:
        """Later parts grow from this one."""
        self.carried = self.at(part)

    def state(self) -> dict[str, Any]:
        """The values for a checkpoint."""
        return dict(vars(self))

    def restore(self, state: Mapping[str, Any]) -> None:
        """The reverse of :meth:`state`."""
        vars(self).update(state)


def check_same_number(what: str, stored: int, made: int) -> None:
    """Check that a stored state has as many loads or supports as the script has made.

    Raises:
        CheckpointError: It has another number of them.
    """
    if stored != made:
        raise CheckpointError(
            f"the run had {stored} {what}s of a kind when it was stored, and the script made {made}. "
            f"They were changed while it ran (each=): expected {what}s to change between two phases"
        )
