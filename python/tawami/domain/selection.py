"""Some of the particles of a body, as a driver script names them."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from tawami.base import checks, ranks
from tawami.base.arrays import Array, Indices, Mask
from tawami.base.errors import InputError
from tawami.domain.domain import Domain
from tawami.domain.model import Model
from tawami.particles.following import OfParticles

#: A mask of the particles of the body as the script has it, their numbers, a function f(x, y) of
#: position on arrays, or the name of a group of the body.
Where = npt.ArrayLike | Callable[[Array, Array], Any] | str


def present(domain: Domain, what: str, where: Where) -> Mask:
    """Mask of some of this rank's particles; a call for all ranks.

    Args:
        domain: The particles where they are.
        what: The call and its argument, for messages.
        where: The particles. A function is called with their present positions.

    Raises:
        InputError: None of the kinds of `Where`, not the same on all ranks, or no particle.
    """
    model, number = domain.model, np.asarray(domain.particles.number)
    comm = model.grid.comm
    if callable(where) or isinstance(where, str):
        with ranks.raise_together(comm):
            mask = _inside(domain, what, where) if callable(where) else _named(domain, what, where)
        _check_any(comm, what, bool(mask.any()))
        return mask
    given, everywhere = _given(domain, what, where)
    _check_any(comm, what, len(given) > 0)
    return OfParticles(comm, given, np.ones(len(given)), everywhere=everywhere).at(number) > 0


def in_order(domain: Domain, what: str, where: Where) -> tuple[Indices, bool]:
    """Numbers of some particles in the order in which a driver script has their rows, and whether every
    rank has all of them; a call for all ranks.

    In the order given, or as the particles of the body. Arguments and errors are those of
    :func:`present`.
    """
    model = domain.model
    if not (callable(where) or isinstance(where, str)):
        number, everywhere = _given(domain, what, where)
        _check_any(model.grid.comm, what, len(number) > 0)
        return number, everywhere
    mask = present(domain, what, where)
    if model.part is not None:
        along = ranks.looked_up(
            model.grid.comm, domain.particles.number.astype(np.int64), mask, model.part.number
        )
        return model.part.number[along], False
    mine = np.asarray(domain.particles.number)[mask].astype(np.int64)
    return np.sort(ranks.allgathered(model.grid.comm, mine)), True


def _check_any(comm: Any, what: str, found: bool) -> None:
    if not ranks.anywhere(comm, found):
        raise InputError(f"{what}: no particle was chosen: expected at least one")


def _given(domain: Domain, what: str, where: Any) -> tuple[Indices, bool]:
    """Numbers from a mask of the body of the script, or from numbers, and whether every rank has all."""
    model = domain.model
    comm, part = model.grid.comm, model.part
    with ranks.raise_together(comm):
        given = checks.any_array(what, where)
        is_mask = given.dtype == bool and given.shape == (model.along_body,)
        chosen = np.flatnonzero(given) if is_mask else _numbers(what, given, where, model)
    if is_mask and part is not None:
        return part.number[chosen], False
    digests = comm.allgather(hashlib.sha1(chosen.tobytes()).digest())
    if len(set(digests)) > 1:
        raise InputError(
            f"{what} is not the same on all ranks: expected the same numbers on each, as of "
            "body.number, a mask of body.x, or a function of position"
        )
    return chosen, True


def _numbers(what: str, given: Any, where: Any, model: Model) -> Indices:
    """Numbers of particles, as they were given."""
    n = model.num_particles
    right = given.dtype.kind in "iu" and given.ndim == 1
    if not (right and ((given >= 0) & (given < n)).all()) and given.shape != (0,):
        raise InputError(
            f"{what} = {checks.shown(where)}: expected a mask of the {model.along_body} particles of "
            "the body, or their numbers (as scene.particles.number), a function f(x, y) of position, or "
            "the name of a group"
        )
    return np.asarray(given, dtype=np.int64)


def _named(domain: Domain, what: str, where: str) -> Mask:
    """The mask of this rank's particles in a group."""
    names = domain.model.names
    if not names:
        raise InputError(
            f"{what} = {checks.shown(where)}: the body has no groups with names: expected a body of "
            "body.named(...) or of a mesh with groups; or a mask, numbers, or a function f(x, y)"
        )
    name = checks.choice(what, where, dict.fromkeys(names))
    with_name = np.array([one == name for one in names])
    return np.asarray(with_name[domain.particles.material])


def _inside(domain: Domain, what: str, where: Callable[..., Any]) -> Mask:
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
