"""Particles as squares in colours, with a colour bar."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from tawami.base.arrays import Array
from tawami.picture import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Share of the particles of a picture whose values may lie outside the range of colours.
OUTLIERS = 0.01
CORNERS = 0.5 * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])


@dataclass(frozen=True)
class Corners:
    """Corners of the grid [m]."""

    lower: Array
    upper: Array


@dataclass(frozen=True)
class Scale:
    """Colours of a quantity.

    Attributes:
        label: Of the colour bar.
        factor: Values over the numbers of the colour bar.
        low, high: Its ends.
        colours: Name of the map.
        extend: Ends that values exceed: 'neither', 'min', 'max' or 'both'.
    """

    label: str
    factor: float
    low: float
    high: float
    colours: str
    extend: str


def scale_of(
    name: str, unit: str, values: Sequence[Array], limits: tuple[float, float] | None = None
) -> Scale:
    """Colours of a quantity: a map for both signs, symmetric about 0, if the values have both.

    Args:
        name: Of the quantity.
        unit: Of the values.
        values: Of one picture or several.
        limits: Ends of the range, in the unit; by default the values without outliers.
    """
    if limits is None:
        share = [OUTLIERS / 2, 1 - OUTLIERS / 2]
        outer = np.array([np.quantile(v, share) for v in values if len(v)] or [np.zeros(2)])
        low, high = float(outer[:, 0].min()), float(outer[:, 1].max())
        largest = max((np.abs(v).max(initial=0.0) for v in values), default=0.0)
    else:
        (low, high), largest = limits, max(map(abs, limits))
    unit, factor = style.scaled(unit, float(largest))
    low, high = low / factor, high / factor
    colours = style.MAGNITUDE
    if low < 0 < high and min(-low, high) > 0.2 * max(-low, high):
        colours = style.SIGNED
        if limits is None:
            high = max(-low, high)
            low = -high
    elif not high > low:
        high = low + 1e-12 + 1e-9 * abs(low)
    below = any(v.min(initial=np.inf) / factor < low for v in values)
    above = any(v.max(initial=-np.inf) / factor > high for v in values)
    extend = "both" if below and above else "min" if below else "max" if above else "neither"
    return Scale(style.labelled(name, unit), factor, low, high, colours, extend)


class Squares:
    """Particles as squares on axes, in the unit of their positions.

    Args:
        axes: Of matplotlib.
        scale: Their colours.
    """

    def __init__(self, axes: Axes, scale: Scale) -> None:
        from matplotlib.collections import PolyCollection

        self._scale = scale
        self.artist = PolyCollection([], cmap=scale.colours, edgecolors="face", linewidths=0.6)
        self.artist.set_clim(scale.low, scale.high)
        self.artist.set_zorder(2)
        axes.add_collection(self.artist, autolim=False)
        if scale.colours == style.SIGNED:
            axes.set_facecolor(style.BEHIND)  # the middle of the map is white

    def show(self, x: Array, shape: Array | float, values: Array) -> None:
        """Show particles.

        Args:
            x: Positions [m], particles x 2.
            shape: Sides of squares [m], one for all or one each, or edges of parallelograms as columns,
                particles x 2 x 2.
            values: Their values.
        """
        edges = np.asarray(shape, dtype=float)
        if edges.ndim < 2:
            edges = np.broadcast_to(edges, len(x))[:, None, None] * np.eye(2)
        self.artist.set_verts(x[:, None, :] + CORNERS @ edges.transpose(0, 2, 1))
        self.artist.set_array(values / self._scale.factor)

    def add_bar(self, axes: Axes | Sequence[Axes], **where: Any) -> None:
        """Add the colour bar below the axes, or where the arguments of `Figure.colorbar` say."""
        # without pad=, with which the layout needs three draws to fit
        usual = {"ax": axes, "orientation": "horizontal", "fraction": 0.06, "aspect": 45}
        scale, figure = self._scale, self.artist.figure
        assert figure is not None
        figure.colorbar(self.artist, extend=scale.extend, label=scale.label, **(where or usual))

    def add_bar_beside(self, axes: Axes) -> None:
        """Add the colour bar at the right, as high as the axes."""
        self.add_bar(axes, cax=axes.inset_axes((1.03, 0.0, 0.035, 1.0)))


def draw_border(axes: Axes, sides: Array) -> Any:
    """Draw the border of a body as a thin line; return the artist.

    Args:
        axes: Of matplotlib.
        sides: Ends of its sides [m], sides x 2 x 2.
    """
    from matplotlib.collections import LineCollection

    lines = LineCollection(list(sides), colors="0.15", linewidths=0.7, capstyle="projecting")
    lines.set_zorder(3)
    axes.add_collection(lines, autolim=False)
    return lines


def view(x: Array, grid: Corners) -> tuple[Array, Array]:
    """Corners of the view: the grid, or the part of it that particles at x reach."""
    lower, upper = x.min(axis=0), x.max(axis=0)
    margin = 0.06 * (upper - lower).max() + 1e-12
    size = grid.upper - grid.lower
    far = size > 2.0 * (upper - lower) + 2 * margin
    first, last = grid.lower - 0.3 * margin, grid.upper + 0.3 * margin
    first = np.minimum(first, lower - 0.3 * margin)  # a body may be drawn beyond the grid
    last = np.maximum(last, upper + 0.3 * margin)
    inside = np.maximum(lower - margin, first), np.minimum(upper + margin, last)
    return np.where(far, inside[0], first), np.where(far, inside[1], last)


def size_of(lower: Array, upper: Array) -> tuple[float, float]:
    """Width and height of a figure with axes of this shape and a colour bar below [inches]."""
    width, height = upper - lower
    side = min(7.2, 7.0 * width / height)
    return max(side, 3.2) + 0.9, side * height / width + 1.4


def draw_frame(axes: Axes, lower: Array, upper: Array, grid: Corners) -> None:
    """Set limits and labels of axes, and draw the border of the grid."""
    axes.set_aspect("equal")
    axes.set_xlim(lower[0], upper[0])
    axes.set_ylim(lower[1], upper[1])
    axes.set_xlabel(style.labelled("$x$", "m"))
    axes.set_ylabel(style.labelled("$y$", "m"))
    middle, size = 0.5 * (grid.lower + grid.upper), grid.upper - grid.lower
    border = middle + size * CORNERS[[0, 1, 2, 3, 0]]
    axes.plot(*border.T, color="0.35", linewidth=1.2, zorder=1)
