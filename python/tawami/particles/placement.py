"""Cell and rank of each particle, and the particles that left the grid."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Collection, Mapping
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from tawami import _rust
from tawami.base import ranks
from tawami.base.arrays import Array, Mask
from tawami.base.errors import CheckpointError, InputError
from tawami.base.shared_file import Rows, by_number
from tawami.grid.grid import EDGES, Edge, Grid
from tawami.particles.work import Work

#: Least distance of moving particles from the sides of their cell [cells]. A single particle on a side
#: would leave functions beyond it without stiffness and mass.
MARGIN = 1e-5
#: Distance beyond a wall at which a particle that moves is taken as on it [cells]: contact acts on means
#: over patches of the border, so that a corner or a curved border may pass it a little.
BEYOND = 0.5


class Placed(NamedTuple):
    """Particles where they are.

    Attributes:
        grid: The grid with the cells of each rank.
        particles: The particles in those of this rank.
        location: Their cells in its window.
    """

    grid: Grid
    particles: _rust.Particles
    location: _rust.Location


def located(grid: Grid, x: Array, *, moving: bool, moved: bool = True) -> _rust.Location:
    """Cells of particles; moving particles are placed away from the sides of their cells.

    Args:
        grid: The grid.
        x: Positions [m], particles x dim.
        moving: Whether particles move.
        moved: Whether they may have passed a wall a little.
    """
    if moving and moved:
        on_edge = np.clip(x, grid.origin, grid.upper)
        x = np.where(np.abs(x - on_edge) <= BEYOND * grid.h, on_edge, x)
    location = grid.rust.locate(x)
    return location.away_from_sides(MARGIN) if moving else location


def outside(grid: Grid, x: Array, walls: Collection[Edge] = ()) -> Mask:
    """Whether each position is outside the grid, by more than the round-off that Rust accepts, or than
    a particle may be beyond a wall.

    Args:
        grid: The grid.
        x: Positions [m], points x dim.
        walls: Edges with walls.
    """
    inside = np.ones(len(x), dtype=bool)
    for edge in EDGES:
        margin = BEYOND if edge in walls else 1e-9
        inside &= grid.inwards(edge, x) >= -margin * grid.h
    return ~inside


def distributed(
    grid: Grid, body: _rust.Particles, moving: bool, *, whole: bool = True, moved: bool = False
) -> Placed:
    """The particles in this rank's cells, which the particles divide; a collective call.

    Args:
        grid: The grid.
        body: Particles of the body.
        moving, moved: As of `located`.
        whole: Whether every rank has all of them; else each is on one rank.

    Raises:
        InputError: Particles are outside the grid, or a whole body is not the same on all ranks.
    """
    comm = grid.comm
    if whole and comm.size > 1:
        parts = (body.x, body.volume, body.material)
        digest = hashlib.sha1(b"".join(part.tobytes() for part in parts)).digest()
        if len(set(comm.allgather(digest))) > 1:
            raise InputError(
                "the body is not the same on all ranks: expected the same positions, volumes and "
                "materials on each. Give random numbers a seed, or make it on one rank and bcast it; to "
                "move or choose particles of box(...) and other shapes, whose ranks have a part each, "
                "use dataclasses.replace(body, x=...) or body[mask]"
            )
        body = body.select(np.arange(comm.rank, len(body), comm.size, dtype=np.uint32))
    with ranks.raise_together(comm):
        location = located(grid, body.x, moving=moving, moved=moved)
    return migrated(
        grid.divided_by(location.cell.astype(np.int64)), body, moving=moving, moved=moved
    )


def columns(particles: _rust.Particles) -> list[tuple[str, int]]:
    """Names and widths of the arrays of particles, in the order of their rows."""
    double = np.dtype(float).itemsize
    return [(name, max(1, size // double)) for name, size in particles.arrays]


def in_order(comm: Any, number: npt.NDArray[Any]) -> Callable[[npt.ArrayLike], Any]:
    """A function that gathers arrays of particles on every rank, in the order of their numbers.

    This and the function are collective calls.
    """
    order = np.argsort(ranks.allgathered(comm, np.asarray(number)), kind="stable")
    return lambda values: ranks.allgathered(comm, np.asarray(values))[order]


def arrays(particles: _rust.Particles) -> dict[str, Array]:
    """Arrays of the particles of this rank by name, each particles x components."""
    names, widths = zip(*columns(particles), strict=True)
    parts = np.split(particles.rows(), np.cumsum(widths)[:-1], axis=1)
    return dict(zip(names, map(np.ascontiguousarray, parts), strict=True))


def stored(comm: Any, particles: _rust.Particles) -> dict[str, Rows]:
    """Arrays of the particles of all ranks by name, in the order of their numbers, in equal blocks."""
    sort = by_number(comm, particles.number)
    return {name: sort(values) for name, values in arrays(particles).items()}


def restored(
    grid: Grid,
    particles: _rust.Particles,
    work: Work,
    state: Mapping[str, Any],
    *,
    moving: bool,
) -> Placed:
    """The particles of a state, the reverse of :func:`stored`; a collective call.

    Args:
        grid: The grid.
        particles: Particles of the scene. The result has the same object, with the values of the state,
            if the particles of this rank are the same.
        work: Work of the ranks; changes to that of the state.
        state: "particles" as :func:`stored` gives them, and "work".
        moving: As of `located`.

    Raises:
        CheckpointError: The arrays are not those of the particles.
    """
    given = state["particles"]
    wanted = dict(columns(particles))
    found = {name: array.shape[1] for name, array in given.items()}
    if wanted != found:
        differ = sorted(set(wanted.items()) ^ set(found.items()))
        raise CheckpointError(
            f"its particles have other arrays than those of the scene: {differ[0][0]} is in one of them "
            "only, or has another width. Expected the same form, laws and motion"
        )
    whole = not isinstance(given["x"], Rows)
    parts = (given[name] for name in wanted)
    rows = np.hstack([part.own if isinstance(part, Rows) else part for part in parts])
    same, mine = work.restore(grid, state["work"]), particles.of_rows(rows)
    if same is None:  # written by another number of ranks
        placed = distributed(grid, mine, moving, whole=whole, moved=True)
    else:
        placed = migrated(same, mine, moving=moving)
    if not particles.assign(placed.particles):
        return placed
    return Placed(placed.grid, particles, placed.location)


def numbered(particles: _rust.Particles, number: npt.NDArray[Any]) -> _rust.Particles:
    """The same particles with other numbers."""
    names, widths = zip(*columns(particles), strict=True)
    rows = particles.rows()
    rows[:, sum(widths[: names.index("number")])] = number
    return particles.of_rows(rows)


def migrated(
    grid: Grid, particles: _rust.Particles, *, moving: bool = True, moved: bool = True
) -> Placed:
    """Move particles to the rank of their cell, in the order of their numbers; a collective call.

    Raises:
        InputError: Particles are outside the grid.
    """
    comm = grid.comm
    while True:
        with ranks.raise_together(comm):
            location = located(grid, particles.x, moving=moving, moved=moved)
        if comm.size == 1:
            return Placed(grid, particles, grid.window.place(location))
        rank = grid.division.rank_of(grid.cell_indices(location.cell.astype(np.int64)))
        if not ranks.anywhere(comm, (rank != comm.rank).any()):
            return Placed(grid, particles, grid.window.place(location))
        particles = particles.of_rows(ranks.exchanged(comm, particles.rows(), rank))
        particles = particles.select(np.argsort(particles.number).astype(np.uint32))


def shared(grid: Grid, particles: _rust.Particles, work: Work) -> Placed:
    """Move particles to the rank of their cell after a step, and cells to other ranks where that pays.

    A collective call.

    Args:
        grid: The grid with the cells of each rank so far.
        particles: Particles that have moved.
        work: Work of the ranks.
    """
    placed = migrated(grid, particles)
    other = work.redivided(grid, placed.location)
    return placed if other is grid else migrated(other, placed.particles)


def leaving(
    grid: Grid,
    particles: _rust.Particles,
    x: Array,
    time: float,
    *,
    stop: bool,
    walls: Collection[Edge] = (),
) -> Mask:
    """Mask of the particles of this rank that leave the grid when a step moves them to x.

    Args:
        grid: The grid.
        particles: The particles of this rank.
        x: Their new positions [m].
        time: Time at the end of the step [s]; NaN in a static scene.
        stop: Whether it is an error if any particle leaves the grid.
        walls: Edges with walls.

    Raises:
        InputError: A particle leaves the grid, or the last one does.
    """
    gone = outside(grid, x, walls)
    with ranks.raise_together(grid.comm):
        if gone.any() and stop:
            p = np.flatnonzero(gone)[0]
            when = "" if np.isnan(time) else f" at {time:g} s"
            raise InputError(
                f"particle {particles.number[p]} would leave the grid{when}, at ({x[p, 0]:g}, "
                f"{x[p, 1]:g}) m, and {gone.sum() - 1} others with it: expected a grid that holds the "
                "motion, or Scene(..., leaving='remove'). Nothing was changed"
            )
    if not ranks.anywhere(grid.comm, not gone.all()):
        raise InputError("the last particle would leave the grid, and no body would remain")
    return gone


def removed(
    grid: Grid, particles: _rust.Particles, gone: Mask
) -> tuple[_rust.Particles, list[tuple[int, tuple[float, float]]]]:
    """The particles of this rank that stay; number and position [m] of the others, on all ranks.

    Args:
        grid: The grid.
        particles: The particles of this rank.
        gone: Whether each of them is removed.
    """
    mine = [
        (int(particles.number[p]), (float(particles.x[p, 0]), float(particles.x[p, 1])))
        for p in np.flatnonzero(gone)
    ]
    if gone.any():
        particles = particles.select(np.flatnonzero(~gone).astype(np.uint32))
    return particles, [one for part in grid.comm.allgather(mine) for one in part]
