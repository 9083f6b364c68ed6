"""The border of the body in a scene, and the parts of it that loads and supports own."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from tawami import _rust
from tawami.base import checks, stored
from tawami.base.arrays import Array, Indices, Mask
from tawami.base.errors import CheckpointError, InputError, SupportWarning
from tawami.base.text import meant, quoted
from tawami.base.warn import warn
from tawami.border.curves import left
from tawami.border.pieces import Border
from tawami.border.points import BorderPoints
from tawami.domain import spacing
from tawami.domain.border_fits import check_fits
from tawami.domain.domain import Domain
from tawami.domain.excavation import Excavation
from tawami.domain.model import Model
from tawami.domain.moving_points import SAMPLES, MovingPoints, halve, moved
from tawami.grid.grid import EDGES, ON_LINE, Edge

#: Gauss points on a piece of the border between two lines of the grid: where particles stay, three are
#: exact; points that move to other places in their cells need five (noise of a pressure .5 and .14 %).
STAYING, MOVING = 3, 5
#: Part of a border, as a driver script names it: a name or names, a function f(x, y) on arrays that
#: returns a mask, or a mask of the points `scene.border.x`.
Part = (
    str
    | int
    | list[str | int]
    | tuple[str | int, ...]
    | Callable[[Array, Array], Any]
    | npt.NDArray[Any]
)


class User(Protocol):
    """One that has numbers at points of the border."""

    def keep(self, kept: Mapping[MovingPoints, Indices]) -> None:
        """Keep the numbers of points.

        Args:
            kept: For each part of the border the place that each point had before; several may be parts
                of one.
        """


class SceneBorder:
    """The border of the body of a scene.

    Args:
        model: Grid, form and laws of the scene; its border is None for a body without one.
        particles: The particles of this rank.

    Attributes:
        points: All points; None for a body without a border.
        parts: Points that actions own.
        users: Those that have numbers at the points.
    """

    def __init__(self, model: Model, particles: _rust.Particles) -> None:
        self._grid, self._given = model.grid, model.border
        self._lines = model.grid if model.moves else model.grid.halved
        self._count = MOVING if model.moves else STAYING
        self.points: MovingPoints | None = None
        self._ends: MovingPoints | None = None
        #: Pieces between two lines of the grid at the start; numbers of those that are left, and the
        #: shares of the length between which they are.
        self._pieces_at_lines: Border | None = None
        self._left, self._shares = np.zeros(0, dtype=np.int64), np.zeros((0, 2))
        self._has_moved = self._told = False
        self.parts: list[MovingPoints] = []
        self.users: list[User] = []
        if (border := model.border) is not None:
            area = particles.volume / model.space.thickness(particles.x)
            check_fits(self._grid, border.points(self._grid, STAYING), particles.x, area)
            self.points = MovingPoints(border.points(self._lines, self._count), self._grid)
            self._pieces_at_lines = border.at_lines(self._grid)
            self._left = np.arange(len(self._pieces_at_lines.start))
            self._shares = np.tile([0.0, 1.0], (len(self._left), 1))
            if model.moves:
                self._ends = MovingPoints(_ends(self._pieces_at_lines), self._grid)

    @property
    def all(self) -> list[MovingPoints]:
        """All points that move with the body."""
        own = [points for points in (self.points, self._ends) if points is not None]
        return own + self.parts

    @property
    def names(self) -> tuple[str, ...]:
        """Names of its parts."""
        return () if self._given is None else self._given.names

    @property
    def x(self) -> Array:
        """Present positions of its points [m], points x dim; none for a body without a border."""
        return np.zeros((0, self._grid.space.dim)) if self.points is None else self.points.x

    def __repr__(self) -> str:
        if self.points is None:
            return "SceneBorder(none)"
        length = self.points.length.sum()
        return f"SceneBorder({len(self.points)} points, {length:.6g} m: {', '.join(self.names)})"

    def part(self, what: str, where: Part, *, joined: bool = False) -> MovingPoints:
        """Points of a part of the border, which are exact for this part at its present place. Its owner
        adds them to `parts`.

        Args:
            what: The call, for messages.
            where: The part.
            joined: Chains of points do not end where only the name changes, as an obstacle needs it.

        Raises:
            InputError: The body has no border, no part of this name, or nothing where the function or
                mask is true.
        """
        if self._given is None or self.points is None:
            raise InputError(
                f"{what}: the body has no border, as it was made of loose particles: expected "
                "Body(x, volume, border=tawami.polyline(corners)), or a body of box, polygon, disc, "
                "level_set or mesh"
            )
        middle: Array | None = None
        if isinstance(where, np.ndarray):
            mask = self._mask(what, where)
            points, middle = self.points.now[mask], self.points.stretch[mask]
        else:
            pieces = self._pieces(what, where)
            if joined:
                pieces = replace(pieces, tag=np.zeros_like(pieces.tag), names=("border",))
            points = pieces.points(self._lines, self._count)
        if not len(points):
            raise InputError(
                f"{what}: no point of the border is in this part: expected some of it; the border has "
                f"{quoted(self.names)}"
            )
        found = MovingPoints(points, self._grid, what, middle)
        found.touched = joined
        return found

    def _pieces(self, what: str, where: Part) -> Border:
        """The pieces of a part."""
        border = self._present
        if callable(where):
            try:
                return border.where(self._grid, where)
            except InputError as error:
                raise InputError(f"{what}: {error}") from None
        names = [where] if isinstance(where, str | int) else list(where)
        found = [self._named(what, border, str(name)) for name in names]
        chosen = np.any(found, axis=0)
        return border[chosen]

    def _named(self, what: str, border: Border, name: str) -> Mask:
        """Mask of the pieces of this name, or on this edge of the grid."""
        if name in border.names:
            return np.asarray(border.tag == border.names.index(name))
        if name in EDGES:
            ends = [self._grid.inwards(name, x) for x in (border.start, border.end)]
            along = (np.abs(ends) <= ON_LINE * self._grid.h).all(axis=0)
            mask: Mask = along & (border.curvature == 0)
            if mask.any():
                return mask
        known = quoted(self.names)
        raise InputError(
            f"{what}: the border has no part {checks.shown(name)}, and does not lie on an edge of the "
            f"grid of this name: expected one of {known}, or a function f(x, y)"
            f"{meant(name, self.names)}"
        )

    def _mask(self, what: str, where: npt.NDArray[Any]) -> Mask:
        assert self.points is not None
        where = checks.any_array(f"{what}: the mask", where)
        if where.dtype != bool or where.shape != (len(self.points),):
            raise InputError(
                f"{what}: a mask of type {where.dtype} and shape {where.shape}: expected True or False "
                f"for each of the {len(self.points)} points scene.border.x"
            )
        return where

    @property
    def _present(self) -> Border:
        """The border as it is: after a motion its pieces between lines of the grid are straight."""
        assert self._given is not None
        assert self._pieces_at_lines is not None
        if self._ends is None or not self._has_moved:
            whole = len(self._left) == len(self._pieces_at_lines.start)
            if whole and (self._shares == (0.0, 1.0)).all():
                return self._given
            return self._pieces_at_lines.between(self._left, *self._shares.T)
        start, end = np.split(self._ends.x, 2)
        tag = self._pieces_at_lines.tag[self._left]
        return Border(start, end, np.zeros(len(start)), tag, self._given.names)

    def whole_edges(self, part: MovingPoints) -> dict[Edge, Mask]:
        """Edges of the grid that a part covers as far as the border lies on them, with masks of its
        points there.
        """
        found: dict[Edge, Mask] = {}
        assert self.points is not None
        for edge in EDGES:
            mask = part.edge(edge)
            covered = part.length[mask].sum()
            whole = self.points.length[self.points.edge(edge)].sum()
            if covered > 0 and abs(covered - whole) <= ON_LINE * self._grid.h:
                found[edge] = mask
        return found

    def divide(self) -> None:
        """Divide points and pieces where the border has been stretched."""
        if self._ends is not None:
            of = halve(self._ends, self._grid.h)
            if len(of) > len(self._left):
                self._left, self._shares = self._left[of], self._shares[of]
        all_points = [points for points in self.all if points is not self._ends]
        if any(points.is_stretched for points in all_points):
            kept = {points: points.divide() for points in all_points}
            for user in self.users:
                user.keep(kept)

    def excavate(self, excavation: Excavation) -> None:
        """Drop the border where particles are removed; a call for all ranks."""
        if self._pieces_at_lines is not None:
            self._excavate_pieces(excavation, self._pieces_at_lines)
        kept = {part: part.excavate(excavation) for part in self.all if part is not self._ends}
        for user in self.users:
            user.keep(kept)

    def _excavate_pieces(self, excavation: Excavation, pieces: Border) -> None:
        moved = self._ends is not None and self._has_moved
        present = self._present if moved else pieces.between(self._left, *self._shares.T)
        n = len(present.start)
        each, samples = np.repeat(np.arange(n), SAMPLES), np.linspace(0.0, 1.0, SAMPLES)
        x = present.at(each, np.tile(samples, n)).reshape(n, SAMPLES, -1)
        of, low, high = excavation.parts(x)
        left, (first, last) = self._left[of], self._shares[of].T
        if self._ends is not None:
            cut = present.between(of, low, high)
            self._ends.keep(np.concatenate([of, of + n]))
            self._ends.x = np.concatenate([cut.start, cut.end])
        self._left = left
        self._shares = first[:, None] + (last - first)[:, None] * np.stack([low, high], axis=1)

    def moved(self, domain: Domain, u: Array) -> list[tuple[Array, Array]]:
        """Positions and areas of all points after a step, for :meth:`move`.

        Warns:
            SupportWarning: Once, where the border of loads and supports has left the particles.
        """
        found = moved(self.all, domain, u)
        ends = found[len(found) - len(self.parts) :]
        growth = 0.0 if self._told else _growth(self.parts, ends)
        told = spacing.outgrown(domain, growth)
        self._told |= bool(told)
        if told and self._grid.comm.rank == 0:
            warn(told, SupportWarning)
        return found

    def move(self, moved: list[tuple[Array, Array]]) -> None:
        """Move all points."""
        for points, (x, area) in zip(self.all, moved, strict=True):
            points.x, points.area = x, area
        self._has_moved = True

    def state(self) -> dict[str, Any]:
        """Positions and areas of all points, for a checkpoint."""
        return {
            "moved": self._has_moved, "left": self._left, "shares": self._shares,
            "points": [points.state() for points in self.all],
        }  # fmt: skip

    def restore(self, state: Mapping[str, Any]) -> None:
        """The reverse of :meth:`state`.

        Raises:
            CheckpointError: Other parts of the border.
        """
        stored.check_count(
            "parts of the border", len(state["points"]), len(self.all),
            "the same loads and supports, made between two phases",
        )  # fmt: skip
        count = 0 if self._pieces_at_lines is None else len(self._pieces_at_lines.start)
        left = stored.some_of("pieces of the border", state["left"], count, repeated=True)
        shares = stored.values("shares of the pieces", state["shares"], (len(left), 2))
        for points, given in zip(self.all, state["points"], strict=True):
            points.restore(given)
        if self._ends is not None and len(self._ends) != 2 * len(left):
            raise CheckpointError(
                f"the border has {len(left)} pieces in the checkpoint, and {len(self._ends)} ends: "
                "expected two of each"
            )
        self._has_moved, self._left, self._shares = bool(state["moved"]), left, shares


def label(where: Part) -> str:
    """A part of a border in words.

    Raises:
        InputError: It is no part.
    """
    if callable(where):
        return "where f(x, y)"
    if isinstance(where, np.ndarray):
        return f"{np.count_nonzero(where)} points"
    names = list(where) if isinstance(where, list | tuple) else [where]
    if not names or not all(isinstance(name, str | int) for name in names):
        raise InputError(
            f"a part of the border = {checks.shown(where)}: expected a name or names of it, a function "
            "f(x, y) that returns a mask, or a mask of the points scene.border.x"
        )
    return ", ".join(repr(name) for name in names)


def _growth(parts: Sequence[MovingPoints], moved: Sequence[tuple[Array, Array]]) -> float:
    """The largest growth of a piece of the border in some parts, which have moved."""
    pairs = zip(parts, moved, strict=True)
    grown = (part.growth(area) for part, (_, area) in pairs if not part.touched)
    return max(grown, default=0.0)


def _ends(border: Border) -> BorderPoints:
    """The ends of pieces as points without lengths and chains: where they start, then where they end."""
    x = np.concatenate([border.start, border.end])
    of = np.tile(np.arange(len(border.start)), 2)
    along = (border.end - border.start)[of]
    normal = -left(along) / np.linalg.norm(along, axis=1)[:, None]
    one, number = np.ones(len(x)), np.zeros(len(x), dtype=np.int64)
    return BorderPoints(x, one, normal, border.tag[of], border.names, number, 0 * one)
