"""Series of files in time: VTU files with a PVD index, which ParaView and pyvista open.

Every file is written atomically, and the index, rewritten after it, names only files that exist: a
series opens even if its run was killed.
"""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from xml.etree import ElementTree
from xml.sax.saxutils import quoteattr

from tawami.base.errors import OutputError
from tawami.base.files import atomic_file, reason, result_folder, unreadable, writing
from tawami.results.frame import Frame

ORDER = "LittleEndian" if sys.byteorder == "little" else "BigEndian"
HEAD = (
    f'<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1" byte_order="{ORDER}">\n'
    "<Collection>"
)
TAIL = "</Collection>\n</VTKFile>"
#: A finite number.
NUMBER = r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?"
#: Time, and path of the file from the folder of the index.
Entry = tuple[float, str]


class Series:
    """VTU files in time and their index; for the rank that writes.

    Args:
        folder: Folder of the index NAME.pvd and of the folder NAME with the files.
        name: Of both.
    """

    def __init__(self, folder: Path, name: str) -> None:
        self.folder, self.name = folder, name
        self.files = folder / name
        self.index = folder / f"{name}.pvd"
        self._entries: list[Entry] = []

    def begin(self, last: int | None) -> None:
        """Begin an empty series, or keep the files of the existing one up to a step.

        Raises:
            OutputError: The folder cannot be written, or its index cannot be read.
        """
        result_folder(self.files)
        known = [] if last is None else entries(self.index)
        self._entries = [entry for entry in known if self._exists(entry, last)]
        self._write_index()
        names = {file for _, file in self._entries}
        with writing(self.files):
            for path in self.files.glob(f"{self.name}-*.vtu"):
                if f"{self.name}/{path.name}" not in names:
                    path.unlink()

    def _exists(self, entry: Entry, last: int | None) -> bool:
        """Whether the file of an entry exists, and its step is at most `last`."""
        path = self.folder / entry[1]
        number = path.stem.rpartition("-")[2]
        return os.path.isfile(path) and number.isdecimal() and int(number) <= (last or 0)

    def path(self, step: int) -> Path:
        """Path of the file of a step."""
        return self.files / f"{self.name}-{step:06d}.vtu"

    def add(self, step: int, time: float) -> None:
        """Add the file of a step to the index.

        Raises:
            OutputError: It cannot be written; the series is unchanged.
        """
        path = self.path(step)
        self._entries.append((float(time), f"{self.name}/{path.name}"))
        try:
            self._write_index()
        except OutputError:
            self._entries.pop()
            path.unlink(missing_ok=True)
            raise

    def _write_index(self) -> None:
        rows = [
            f'<DataSet timestep="{time!r}" part="0" file={quoteattr(file)}/>'
            for time, file in self._entries
        ]
        with atomic_file(self.index) as part:
            part.write_text("\n".join([HEAD, *rows, TAIL]) + "\n", encoding="utf-8")


# -- reading, for pictures and for runs that are resumed ---------------------


def entries(index: Path) -> list[Entry]:
    """Entries of an index; none if there is no such file.

    Raises:
        OutputError: It cannot be read.
    """
    if not os.path.lexists(index):
        return []
    try:
        problem = unreadable(index)
        if problem is not None:
            raise OSError(problem)
        found = ElementTree.parse(index).getroot().findall("Collection/DataSet")
        return [_entry(index, k, element.attrib) for k, element in enumerate(found, 1)]
    except (OSError, ElementTree.ParseError, ValueError) as error:
        raise OutputError(
            f"'{index}' cannot be read ({reason(error)}): expected the index of a series as this run "
            "wrote it; remove it to start a new series"
        ) from error


def _entry(index: Path, number: int, given: Mapping[str, str]) -> Entry:
    """An entry of an index: a finite time, and a file in the folder of the index."""
    time, file = given.get("timestep", ""), given.get("file", "")
    folder = index.parent.resolve()
    if not re.fullmatch(NUMBER, time.strip()):
        raise ValueError(f"its entry {number} has the time '{time}'")
    if not file or not (folder / file).resolve().is_relative_to(folder):
        raise ValueError(f"its entry {number} has the file '{file}', which is not in this folder")
    return float(time), file


def frames(index: Path) -> list[tuple[float, Callable[[], Frame]]]:
    """Times of a series, and for each a function that reads its frame.

    Raises:
        OutputError: The index cannot be read.
    """
    return [(time, partial(read_vtu, index.parent / file)) for time, file in entries(index)]


def read_vtu(path: Path) -> Frame:
    """Read a file of a series.

    Raises:
        OutputError: It cannot be read.
    """
    import meshio

    try:
        problem = unreadable(path)
        if problem is not None:
            raise OSError(problem)
        mesh = meshio.vtu.read(path)  # meshio.read ends the process on an error
        (block,) = mesh.cells
    except Exception as error:
        raise OutputError(
            f"'{path}' cannot be read ({reason(error)}): expected a file of a series"
        ) from error
    on_cells = {name: values for name, (values,) in mesh.cell_data.items()}
    return Frame(mesh.points, block.type, block.data, dict(mesh.point_data), on_cells)
