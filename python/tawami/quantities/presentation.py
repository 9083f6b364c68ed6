"""Solutions as pictures, as tables of pandas and as meshes of pyvista."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from tawami.base import checks
from tawami.base.arrays import Array
from tawami.base.errors import InputError
from tawami.base.optional import optional
from tawami.base.space import Space
from tawami.grid.grid import Grid
from tawami.picture import style
from tawami.picture.figure import lay_out, shown_axes
from tawami.picture.particles import (
    Corners,
    Squares,
    draw_border,
    draw_frame,
    scale_of,
    size_of,
    view,
)
from tawami.quantities.outline import Outline
from tawami.quantities.quantities import GRADIENT, PARTICLES, Arrays, Given, Quantity
from tawami.quantities.scalars import pick, scalars

if TYPE_CHECKING:
    from matplotlib.axes import Axes


#: Stretch beyond which a particle is drawn as a square, since its parallelogram would be a needle.
MOST_STRETCH = 3.0


def corners_of(grid: Grid) -> Corners:
    """Corners of a grid."""
    return Corners(np.asarray(grid.origin, dtype=float), np.asarray(grid.upper, dtype=float))


def positions(arrays: Arrays, *, moved: bool, deformed: float) -> Array:
    """Positions of the particles with enlarged displacements [m].

    Args:
        arrays: Of the particles.
        moved: Whether their positions contain their displacements, as at finite strain.
        deformed: Factor on the displacements.
    """
    return np.asarray(arrays["x"] + (deformed - moved) * arrays["displacement"])


def shapes(arrays: Arrays, space: Space, *, moved: bool, deformed: float) -> Array:
    """Sides of squares with the areas of the particles [m]; at finite strain the edges of the
    parallelograms that these have become, as columns.

    Args:
        arrays, moved, deformed: As in :func:`positions`.
        space: The space of the grid.
    """
    dim, start = space.dim, positions(arrays, moved=moved, deformed=0.0)
    side = np.asarray((arrays["volume"] / space.thickness(start)) ** (1 / dim))
    if not moved:
        return side
    f = np.eye(dim) + deformed * space.in_space(arrays[GRADIENT])
    f[np.linalg.norm(f, 2, axis=(1, 2)) > MOST_STRETCH] = np.eye(dim)
    return np.asarray(side[:, None, None] * f)


def checked_limits(limits: Any) -> tuple[float, float] | None:
    """Ends of a range of colours, the smaller first.

    Raises:
        InputError: Anything else.
    """
    if limits is None:
        return None
    low, high = checks.pair("limits", limits, "numbers, as (-1e3, 1e3)")
    low = checks.number("limits[0]", low)
    return low, checks.number("limits[1]", high, low=np.nextafter(low, np.inf))


@style.used()
def plot(
    arrays: Arrays,
    grid: Grid,
    given: Given,
    axes: Axes | None,
    *,
    moved: bool,
    deformed: float,
    limits: tuple[float, float] | None,
    more: Mapping[str, Quantity],
    outline: Outline | None = None,
) -> Axes:
    """Draw particles; see `Solution.plot`."""
    deformed, limits = checks.number("deformed", deformed), checked_limits(limits)
    name, unit, values = pick(given, arrays, more)
    x, corners = positions(arrays, moved=moved, deformed=deformed), corners_of(grid)
    lower, upper = view(x, corners)
    new = axes is None
    if axes is None:
        axes = shown_axes(*size_of(lower, upper))
    else:
        from matplotlib.axes import Axes

        checks.instance("plot: axes", axes, Axes, "axes of matplotlib, or None")
    draw_frame(axes, lower, upper, corners)
    squares = Squares(axes, scale_of(name, unit, [values], limits))
    squares.show(x, shapes(arrays, grid.space, moved=moved, deformed=deformed), values)
    if outline is not None:
        draw_border(axes, outline.sides(deformed))
    (squares.add_bar if new else squares.add_bar_beside)(axes)
    factor = "at the start" if deformed == 0 else f"displacements x {deformed:g}"
    axes.set_title(name if deformed == 1 else f"{name}, {factor}")
    if new:
        lay_out(axes.get_figure(root=True))
    return axes


def columns(
    arrays: Arrays, given: Iterable[Given], usual: Iterable[str], more: Mapping[str, Quantity]
) -> dict[str, Array]:
    """Columns "x [m]", "y [m]", "stress xx [Pa]", ...: one number for each particle."""
    found = {"x [m]": arrays["x"]}
    for quantity in _chosen(given, usual, more):
        found[quantity.label] = quantity.values(arrays)
    table = scalars(found, sizes=False)
    return {
        style.labelled(name.removeprefix("x ") if name in ("x x", "x y") else name, unit): values
        for name, (unit, values) in table.items()
    }


def _chosen(
    given: Iterable[Given], usual: Iterable[str], more: Mapping[str, Quantity]
) -> list[Quantity]:
    known = {**PARTICLES, **more}
    chosen = list(given) or list(usual)
    for one in chosen:
        if not isinstance(one, Quantity) and not checks.one_of(one, known):
            raise InputError(
                f"quantity {checks.shown(one)}: expected a tawami.Quantity or one of {', '.join(known)}"
            )
    return [one if isinstance(one, Quantity) else known[one] for one in chosen]


def to_pandas(table: dict[str, Array], number: Array) -> Any:
    """A table with one row for each particle."""
    pandas = optional("pandas", "solution.to_pandas() needs")
    return pandas.DataFrame(table, index=pandas.Index(number, name="particle"))


def fields(
    arrays: Arrays, given: Iterable[Given], usual: Iterable[str], more: Mapping[str, Quantity]
) -> dict[str, Array]:
    """Fields by label, vectors with a third component 0, as VTK expects them."""
    found = {q.label: q.values(arrays) for q in _chosen(given, usual, more)}
    return {label: in_space(values) for label, values in found.items()}


def in_space(values: Array) -> Array:
    """Vectors in the plane with a third component 0; all other fields as they are."""
    if values.ndim == 2 and values.shape[1] == 2:
        return np.pad(values, ((0, 0), (0, 1)))
    return values


def to_pyvista(points: Array, data: dict[str, Array]) -> Any:
    """Points with fields."""
    pyvista = optional("pyvista", "solution.to_pyvista() needs")
    cloud = pyvista.PolyData(points)
    for label, values in data.items():
        cloud.point_data[label] = values
    first = next((label for label, values in data.items() if values.ndim == 1), None)
    cloud.set_active_scalars("mean stress [Pa]" if "mean stress [Pa]" in data else first)
    return cloud
