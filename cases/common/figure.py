"""Figures of the cases as files."""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt

from tawami.results import figure as pictures


def save(figure: plt.Figure, path: Path, *, dpi: int = 160) -> None:
    """Write a figure as PNG, whole or not at all, and close it."""
    pictures.save(figure, path, dpi=dpi)
    plt.close(figure)
