"""Figures of the cases as files."""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
from mpi4py import MPI

from tawami.picture import figure as pictures


def save(figure: plt.Figure, path: Path, *, dpi: int = 160) -> None:
    """Write a figure as PNG on the first rank, and close it. The file is complete or absent."""
    if MPI.COMM_WORLD.rank == 0:
        pictures.save(figure, path, dpi=dpi)
    plt.close(figure)
