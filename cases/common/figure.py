"""Figures of the cases, in the style of the package, and as files."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from mpi4py import MPI

from tawami.picture import figure as pictures
from tawami.picture import style
from tawami.picture.particles import Squares, scale_of

Array = npt.NDArray[np.float64]
#: Colours of the methods in all figures.
COLOURS = {
    f"{form}{strain}": colour
    for form, colour in (("u_epsv", style.VERMILION), ("u_bbar", style.BLUE), ("u", style.GRAY))
    for strain in ("", "_finite")
}

plt.rcParams.update(style.PARAMETERS)


def draw_particles(
    axes: Axes,
    x: Array,
    side: Array | float,
    values: Array,
    unit: str,
    limits: tuple[float, float],
    name: str = "mean stress, tension positive",
) -> Squares:
    """Draw particles as squares in colours.

    Args:
        axes: Of one figure.
        x: Positions [m], particles x 2.
        side: Sides of the squares [m], one for all or one each.
        values: Quantity for the colours.
        unit: Of the values.
        limits: Ends of the range of colours, in this unit.
        name: Of the values.
    """
    squares = Squares(axes, scale_of(name, unit, [values], limits))
    squares.show(x, side, values)
    axes.update_datalim(x)
    axes.autoscale_view()
    axes.set_aspect("equal")
    return squares


def add_bar(squares: Squares, panels: Sequence[Axes] | npt.NDArray[np.object_]) -> None:
    """Add the colour bar of several panels at their right."""
    squares.add_bar(list(np.ravel(panels)), ax=list(np.ravel(panels)), aspect=50)


def save(figure: plt.Figure, path: Path, *, dpi: int = 160) -> None:
    """Write a figure as PNG on the first rank, and close it. The file is complete or absent."""
    if MPI.COMM_WORLD.rank == 0:
        pictures.save(figure, path, dpi=dpi)
    plt.close(figure)
