"""Figures, and figures as files; matplotlib is imported only when one is made."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from tawami.base.files import atomic_file
from tawami.base.optional import optional
from tawami.picture import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


@style.used()
def new_figure(width: float, height: float) -> Figure:
    """A figure of this size [inches], without a window system.

    Raises:
        MissingDependencyError: matplotlib is not installed.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


@style.used()
def shown_axes(width: float, height: float) -> Axes:
    """Axes in a figure of pyplot, which notebooks and `plt.show()` show.

    Raises:
        MissingDependencyError: matplotlib is not installed.
    """
    pyplot = optional("matplotlib.pyplot", "pictures need")
    axes: Axes = pyplot.subplots(figsize=(width, height), layout="constrained")[1]
    return axes


def lay_out(figure: Figure | None) -> None:
    """Place the parts of a figure, which takes a few draws where axes have equal scales."""
    for _ in range(4):
        assert figure is not None
        figure.draw_without_rendering()


@style.used()
def save(figure: Figure, path: str | Path, *, dpi: int = 160) -> None:
    """Write a figure as PNG, atomically.

    Raises:
        OutputError: The file cannot be written.
    """
    with atomic_file(path) as part:
        figure.savefig(part, dpi=dpi, format="png")
