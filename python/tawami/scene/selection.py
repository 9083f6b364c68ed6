"""Some of the particles of a body, as a driver script names them."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from tawami.base import checks, ranks
from tawami.base.arrays import Array, Indices
from tawami.base.errors import InputError
from tawami.scene.domain import Domain

#: A mask of the particles of the body, their numbers, a function f(x, y) of position on arrays, or the
#: name of a group of the body.
Where = npt.ArrayLike | Callable[[Array, Array], Any] | str


def numbers(domain: Domain, what: str, where: Where) -> Indices:
    """Numbers in the body of some particles, in the order given; a call for all ranks.

    Args:
        domain: The particles where they are.
        what: The call and its argument, for messages.
        where: The particles. A function is called with their present positions.

    Raises:
        InputError: None of the kinds of `Where`, not the same on all ranks, or no particle.
    """
    comm, model = domain.model.grid.comm, domain.model
    chosen: Indices
    if callable(where):
        with ranks.raise_together(comm):
            mine = np.asarray(domain.particles.number)[_inside(domain, what, where)]
        chosen = np.sort(ranks.allgathered(comm, mine.astype(np.int64)))
    elif isinstance(where, str):
        if not model.names:
            raise InputError(
                f"{what} = {checks.shown(where)}: the body has no groups with names: expected a body of "
                "body.named(...) or of a mesh with groups; or a mask, numbers, or a function f(x, y)"
            )
        name = checks.choice(what, where, dict.fromkeys(model.names))
        with_name = np.array([one == name for one in model.names])
        mine = np.asarray(domain.particles.number)[with_name[domain.particles.material]]
        chosen = np.sort(ranks.allgathered(comm, mine.astype(np.int64)))
    else:
        with ranks.raise_together(comm):
            chosen = _given(what, where, model.num_particles)
        digests = comm.allgather(hashlib.sha1(chosen.tobytes()).digest())
        if len(set(digests)) > 1:
            raise InputError(
                f"{what} is not the same on all ranks: expected the same mask or numbers on each, as of "
                "body.x, or a function of position"
            )
    if not len(chosen):
        raise InputError(f"{what}: no particle was chosen: expected at least one")
    return chosen


def _given(what: str, where: Any, n: int) -> Indices:
    """Numbers from a mask of the n particles of the body, or from numbers."""
    given = checks.any_array(what, where)
    if given.dtype == bool and given.shape == (n,):
        return np.flatnonzero(given)
    right = given.dtype.kind in "iu" and given.ndim == 1
    if not (right and ((given >= 0) & (given < n)).all()) and given.shape != (0,):
        raise InputError(
            f"{what} = {checks.shown(where)}: expected a mask of the {n} particles of the body, or "
            "their numbers (as scene.particles.number), a function f(x, y) of position, or the name of "
            "a group"
        )
    return given.astype(np.int64)


def _inside(domain: Domain, what: str, where: Callable[..., Any]) -> npt.NDArray[np.bool_]:
    """The mask of this rank's particles that a function of position gives."""
    x = np.array(domain.particles.x)
    if not len(x):  # a rank without particles
        return np.zeros(0, dtype=bool)
    try:
        mask = np.asarray(where(*x.T))
    except Exception as error:
        raise InputError(f"{what}: the function gave {error!r}: expected a mask") from error
    if mask.dtype != bool or mask.shape not in ((len(x),), ()):
        raise InputError(
            f"{what}: the function gave {mask.dtype} of shape {mask.shape} for {len(x)} positions: "
            "expected True or False for each"
        )
    return np.broadcast_to(mask, len(x))
