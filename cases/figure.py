"""Figures of the cases as files."""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt

from tawami.output import whole_file


def save(figure: plt.Figure, path: Path, *, dpi: int = 160) -> None:
    """Write a figure as PNG, whole or not at all, and close it."""
    with whole_file(path) as part:
        figure.savefig(part, dpi=dpi, format="png")
    plt.close(figure)
