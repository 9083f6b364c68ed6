"""Readers of result files that share no code with the package."""

from __future__ import annotations

import csv
from pathlib import Path
from xml.etree import ElementTree

import numpy as np


def pvd(path: Path) -> list[tuple[float, Path]]:
    """Times and files of a series."""
    entries = ElementTree.parse(path).getroot().findall("Collection/DataSet")
    return [(float(e.attrib["timestep"]), path.parent / e.attrib["file"]) for e in entries]


def table(path: Path) -> dict[str, np.ndarray]:
    """Columns of a CSV file by their headings."""
    with path.open(newline="") as file:
        head, *rows = csv.reader(file)
    return dict(zip(head, np.array(rows, dtype=float).T, strict=True))


def contents(folder: Path) -> dict[str, bytes]:
    """Every file below a folder."""
    return {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}
