"""Films of a phase, from the files of its particles."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from tawami.base.arrays import Array
from tawami.base.space import PLANE
from tawami.picture import film
from tawami.picture.particles import Corners, scale_of
from tawami.quantities import scalars as numbers
from tawami.results.frame import Frame

#: Times, and functions that read the frames.
Times = Sequence[tuple[float, Callable[[], Frame]]]
#: Frames of a movie at most.
MOST = 120


def scalars(frame: Frame) -> dict[str, tuple[str, Array]]:
    """Quantities for the colours of particles: name -> (unit, values). Vectors have their size and
    components, tensors their components and quantities that follow from them, such as the mean stress.
    """
    return numbers.scalars(numbers.derived(frame.on_points))


def film_of(
    phase: str, times: Times, quantity: str, grid: Corners, border: Times = ()
) -> film.Film:
    """The particles of a phase in colours.

    Args:
        phase: Name of the phase.
        times: Its series.
        quantity: Quantity for the colours.
        grid: Corners of the grid.
        border: Series of the border, which is drawn at the times that it has.
    """
    sides_at = dict(border)
    wanted = np.unique(np.linspace(0, len(times) - 1, MOST).round().astype(int))
    frames, unit, side = list[film.Frame](), "", 0.0
    for k in wanted:
        time, read = times[k]
        frame = read()
        unit, values = scalars(frame)[quantity]
        x = frame.points[:, : PLANE.dim]
        side = side or _spacing(x)
        sides = _sides(sides_at[time]()) if time in sides_at else None
        frames.append(film.Frame(_title(phase, time), x, side, values, sides))
    return film.Film(frames, scale_of(quantity, unit, [frame.values for frame in frames]), grid)


def _sides(frame: Frame) -> Array:
    """Ends of the lines of a border [m], lines x 2 x 2."""
    return np.asarray(frame.points[frame.cells][:, :, : PLANE.dim])


def _spacing(x: Array) -> float:
    """Distance of neighbours [m]."""
    from scipy.spatial import cKDTree

    if len(x) < 2:
        return 0.0
    return float(np.median(cKDTree(x).query(x, k=2)[0][:, 1]))


def _title(phase: str, time: float) -> str:
    if phase.startswith("ramp"):
        return f"{100 * time:.3g} % of the load"
    if phase.startswith("settle"):
        return f"reset {time:g} of the grid"
    return f"$t$ = {time:.4g} s"
