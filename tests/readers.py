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


def xdmf(path: Path) -> list[tuple[float, dict[str, np.ndarray]]]:
    """Times and arrays of a series in XDMF, by its specification."""
    found = []
    for grid in ElementTree.parse(path).getroot().findall("./Domain/Grid/Grid"):
        arrays = {}
        for child in grid:
            item = child.find("DataItem")
            if item is None:
                continue
            assert (item.attrib["Format"], item.attrib["Endian"]) == ("Binary", "Little")
            kind = {"Float": "f", "Int": "i", "UInt": "u"}[item.attrib["DataType"]]
            raw = (path.parent / item.text).read_bytes()[int(item.attrib["Seek"]) :]
            shape = tuple(map(int, item.attrib["Dimensions"].split()))
            values = np.frombuffer(raw, f"<{kind}{item.attrib['Precision']}", np.prod(shape))
            arrays[child.get("Name") or child.tag] = values.reshape(shape)
        found.append((float(grid.find("Time").attrib["Value"]), arrays))
    return found


def table(path: Path) -> dict[str, np.ndarray]:
    """Columns of a CSV file by their headings."""
    with path.open(newline="") as file:
        head, *rows = csv.reader(file)
    return dict(zip(head, np.array(rows, dtype=float).T, strict=True))


def contents(folder: Path) -> dict[str, bytes]:
    """Every file below a folder."""
    return {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}
