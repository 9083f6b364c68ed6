"""Laws in NumPy of a scene that return no tangent, so that each iteration takes longer."""

from __future__ import annotations

import numpy as np

from tawami.base import ranks
from tawami.base.errors import TangentWarning
from tawami.base.warn import warn
from tawami.domain.domain import Domain
from tawami.particles.numpy_stage import CALLS, NumpyStage


def warn_of_differences(domain: Domain, warned: set[str]) -> None:
    """Warn of laws that returned no tangent, except those of these names, and add theirs.

    A call for all ranks.
    """
    stage, materials = domain.stage, domain.model.materials
    if not isinstance(stage, NumpyStage):
        return
    mine = np.isin(np.arange(len(materials)), list(stage.differenced))
    found = ranks.any_of(domain.model.grid.comm, mine)
    names = {materials[number].name for number in np.flatnonzero(found)} - warned
    warned |= names
    for name in sorted(names) if not domain.model.grid.comm.rank else ():
        warn(
            f"{name} returns no tangent: its derivatives are central differences, so that each "
            f"evaluation calls its function {CALLS} times instead of once. Return (stress, tangent) to "
            "avoid this",
            TangentWarning,
        )
