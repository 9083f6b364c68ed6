"""Figures as files; matplotlib is imported only when one is made."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from tawami.base.errors import MissingDependencyError
from tawami.base.files import atomic_file

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def new_figure(width: float, height: float) -> Figure:
    """A figure of this size [inches], without a window system.

    Raises:
        MissingDependencyError: matplotlib is not installed.
    """
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError as error:
        raise MissingDependencyError("pictures need matplotlib: pip install matplotlib") from error
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def save(figure: Figure, path: str | Path, *, dpi: int = 160) -> None:
    """Write a figure as PNG, atomically.

    Raises:
        OutputError: The file cannot be written.
    """
    with atomic_file(path) as part:
        figure.savefig(part, dpi=dpi, format="png")
