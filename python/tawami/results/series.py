"""Series of files in time: VTU files with a PVD index, or raw numbers with an XDMF index.

A file appears when it is whole, and the index, rewritten after it, names whole files only: a run that
is killed leaves a series that opens.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, get_args
from xml.etree import ElementTree

import numpy as np
import numpy.typing as npt

from tawami.base import checks
from tawami.base.errors import OutputError
from tawami.base.files import result_folder, whole_file

Array = npt.NDArray[Any]
Format = Literal["vtu", "xdmf"]


@dataclass(frozen=True)
class Frame:
    """What one file holds.

    Attributes:
        points: Positions, points x 3 [m].
        kind: Of the cells: 'vertex' or 'quad'.
        cells: Numbers of their points, cells x 1 or 4.
        on_points: Fields by label, points or points x components.
        on_cells: Likewise of the cells.
    """

    points: Array
    kind: Literal["vertex", "quad"]
    cells: Array
    on_points: dict[str, Array] = field(default_factory=dict)
    on_cells: dict[str, Array] = field(default_factory=dict)


def with_z(values: npt.ArrayLike) -> Array:
    """Vectors in the plane as ParaView wants them: n x 2 to n x 3."""
    return np.pad(np.asarray(values, dtype=float), ((0, 0), (0, 1)))


def write_vtu(path: str | Path, frame: Frame) -> None:
    """A VTU file, not compressed: zlib takes five times as long (`python -m cases.costs.writing`).

    Raises:
        OutputError: The file cannot be written, or has another ending.
    """
    import meshio  # here: a scene without output does without it

    if checks.path("path", path).suffix != ".vtu":
        raise OutputError(f"'{path}': expected a file name ending in .vtu")
    cells = [(frame.kind, frame.cells)]
    on_cells = {name: [values] for name, values in frame.on_cells.items()}
    mesh = meshio.Mesh(frame.points, cells, point_data=frame.on_points, cell_data=on_cells)
    with whole_file(path) as part:
        meshio.vtu.write(part, mesh, compression=None)


class Series:
    """Files in time and their index; for the one rank that writes.

    Args:
        folder: Where the index stands, and a folder of the same name for the files.
        name: Of both.
        kind: 'vtu' (NAME.pvd) or 'xdmf' (NAME.xdmf).
    """

    def __init__(self, folder: Path, name: str, kind: Format) -> None:
        self.folder, self.name, self.kind = folder, name, kind
        self.files = folder / name
        self.index = folder / f"{name}.{SUFFIXES[kind][0]}"
        #: Name of each file, and its entry in the index.
        self._entries: list[tuple[str, str]] = []

    def begin(self, last: int | None) -> None:
        """Make the series anew, or keep of the one in the folder what is not later than a step.

        Raises:
            OutputError: The folder cannot be written, or its index cannot be read.
        """
        result_folder(self.files)
        self._entries = [] if last is None else list(self._known(last))
        self._write_index()
        names = {name for name, _ in self._entries}
        for path in self.files.glob(f"{self.name}-*.{SUFFIXES[self.kind][1]}"):
            if path.name not in names:
                path.unlink()

    def _known(self, last: int) -> Iterator[tuple[str, str]]:
        """Entries of the index up to a step whose files are there."""
        for element in entries(self.index):
            path = self.folder / _file(element)
            if path.exists() and int(path.stem.rpartition("-")[2]) <= last:
                yield path.name, _text(element)

    def write(self, step: int, time: float, frame: Frame) -> None:
        """Add a file.

        Raises:
            OutputError: It cannot be written; the series is as it was before.
        """
        path = self.files / f"{self.name}-{step:06d}.{SUFFIXES[self.kind][1]}"
        name = f"{self.name}/{path.name}"
        if self.kind == "vtu":
            write_vtu(path, frame)
            element = ElementTree.Element(
                "DataSet", timestep=repr(float(time)), part="0", file=name
            )
        else:
            element = write_xdmf(path, name, time, frame)
        self._entries.append((path.name, _text(element)))
        try:
            self._write_index()
        except OutputError:
            self._entries.pop()
            path.unlink(missing_ok=True)
            raise

    def _write_index(self) -> None:
        head, tail = FRAMES[self.kind]
        with whole_file(self.index) as part:
            part.write_text("\n".join([head, *(text for _, text in self._entries), tail]) + "\n")


def _text(element: ElementTree.Element) -> str:
    return ElementTree.tostring(element, encoding="unicode").strip()


ORDER = "LittleEndian" if sys.byteorder == "little" else "BigEndian"
#: Endings of the index and of the files.
SUFFIXES: dict[Format, tuple[str, str]] = {"vtu": ("pvd", "vtu"), "xdmf": ("xdmf", "bin")}
#: What stands around the entries of an index.
FRAMES: dict[Format, tuple[str, str]] = {
    "vtu": (
        f'<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1" byte_order="{ORDER}">\n'
        "<Collection>",
        "</Collection>\n</VTKFile>",
    ),
    "xdmf": (
        '<?xml version="1.0"?>\n<Xdmf Version="3.0">\n<Domain>\n'
        '<Grid Name="series" GridType="Collection" CollectionType="Temporal">',
        "</Grid>\n</Domain>\n</Xdmf>",
    ),
}


def check_format(kind: str) -> Format:
    """'vtu' or 'xdmf'.

    Raises:
        InputError: Anything else.
    """
    return checks.choice("format", kind, get_args(Format))  # type: ignore[no-any-return]


def components(label: str, values: Array) -> dict[str, Array]:
    """A tensor 'stress xx yy zz xy [Pa]' as 'stress xx [Pa]' and so on, others as they are."""
    found = re.fullmatch(r"(.*) xx yy zz xy (\[.*\])", label)
    if found is None:
        return {label: np.asarray(values)}
    name, unit = found.groups()
    return {f"{name} {c} {unit}": values[:, k] for k, c in enumerate(("xx", "yy", "zz", "xy"))}


# -- XDMF --------------------------------------------------------------------


def write_xdmf(path: Path, file_name: str, time: float, frame: Frame) -> ElementTree.Element:
    """Write the numbers of a frame one after the other, and return the entry that says where they are;
    components of tensors apart, as readers of XDMF differ in what they know of four.

    Raises:
        OutputError: The file cannot be written.
    """
    grid = ElementTree.Element("Grid", Name=path.stem, GridType="Uniform")
    ElementTree.SubElement(grid, "Time", Value=repr(float(time)))
    kinds = {"vertex": "Polyvertex", "quad": "Quadrilateral"}
    topology = ElementTree.SubElement(
        grid, "Topology", TopologyType=kinds[frame.kind], NumberOfElements=str(len(frame.cells))
    )
    if frame.kind == "vertex":
        topology.set("NodesPerElement", "1")
    geometry = ElementTree.SubElement(grid, "Geometry", GeometryType="XYZ")
    arrays = [(topology, frame.cells.astype(np.int32)), (geometry, frame.points)]
    for centre, data in (("Node", frame.on_points), ("Cell", frame.on_cells)):
        for label, values in data.items():
            for name, part in components(label, values).items():
                kind = "Vector" if part.ndim == 2 else "Scalar"
                attribute = ElementTree.SubElement(
                    grid, "Attribute", Name=name, AttributeType=kind, Center=centre
                )
                arrays.append((attribute, part))
    with whole_file(path) as temporary, temporary.open("wb") as file:
        for parent, values in arrays:
            _data_item(parent, file_name, file.tell(), values)
            file.write(np.ascontiguousarray(values).tobytes())
    return grid


def _data_item(parent: ElementTree.Element, name: str, seek: int, values: Array) -> None:
    item = ElementTree.SubElement(
        parent,
        "DataItem",
        Format="Binary",
        DataType={"i": "Int", "u": "UInt", "f": "Float"}[values.dtype.kind],
        Precision=str(values.dtype.itemsize),
        Dimensions=" ".join(map(str, values.shape)),
        Endian="Little" if sys.byteorder == "little" else "Big",
        Seek=str(seek),
    )
    item.text = name


# -- reading, for pictures and for runs that go on ---------------------------


def entries(index: Path) -> list[ElementTree.Element]:
    """Entries of an index, none where there is no such file.

    Raises:
        OutputError: It cannot be read.
    """
    if not index.exists():
        return []
    try:
        root = ElementTree.parse(index).getroot()
    except (OSError, ElementTree.ParseError) as error:
        raise OutputError(
            f"'{index}' cannot be read ({error}): expected the index of a series as this run wrote it; "
            "remove it to begin the series anew"
        ) from error
    found = root.findall("Collection/DataSet") or root.findall("Domain/Grid/Grid")
    for element in found:
        element.tail = None
    return found


def _file(element: ElementTree.Element) -> str:
    item = element.find(".//DataItem")
    return element.get("file") or (item.text if item is not None else None) or ""


def frames(index: Path) -> list[tuple[float, Callable[[], Frame]]]:
    """Times of a series, and what reads the file of each.

    Raises:
        OutputError: The index cannot be read.
    """
    found: list[tuple[float, Callable[[], Frame]]] = []
    for element in entries(index):
        at = element.find("Time")
        time = float(element.get("timestep") or (at.get("Value") if at is not None else None) or 0)
        read = _read_vtu if element.tag == "DataSet" else _read_xdmf

        def frame(element: ElementTree.Element = element, read: Any = read) -> Frame:
            with _readable(index.parent / _file(element)):
                return read(index.parent, element)  # type: ignore[no-any-return]

        found.append((time, frame))
    return found


@contextmanager
def _readable(path: Path) -> Iterator[None]:
    try:
        yield
    except Exception as error:
        raise OutputError(
            f"'{path}' cannot be read: {error}; expected a file of a series"
        ) from error


def _read_vtu(folder: Path, element: ElementTree.Element) -> Frame:
    import meshio

    mesh = meshio.vtu.read(folder / _file(element))  # meshio.read ends the process on an error
    (block,) = mesh.cells
    on_cells = {name: values for name, (values,) in mesh.cell_data.items()}
    return Frame(mesh.points, block.type, block.data, dict(mesh.point_data), on_cells)


def _read_xdmf(folder: Path, element: ElementTree.Element) -> Frame:
    def values(parent: ElementTree.Element | None) -> Array:
        item = None if parent is None else parent.find("DataItem")
        if item is None:
            raise ValueError("an entry without data")
        shape = [int(n) for n in item.attrib["Dimensions"].split()]
        letter = {"Int": "i", "UInt": "u", "Float": "f"}[item.attrib["DataType"]]
        kind = ("<" if item.get("Endian") == "Little" else ">") + letter + item.attrib["Precision"]
        numbers = np.fromfile(folder / str(item.text), kind, int(np.prod(shape)),
                              offset=int(item.attrib["Seek"]))  # fmt: skip
        return numbers.reshape(shape)

    def fields(centre: str) -> dict[str, Array]:
        return {a.attrib["Name"]: values(a) for a in element.findall("Attribute")
                if a.get("Center") == centre}  # fmt: skip

    cells = values(element.find("Topology"))
    kind: Literal["vertex", "quad"] = "quad" if cells.shape[1] == 4 else "vertex"
    geometry = element.find("Geometry")
    return Frame(values(geometry), kind, cells, fields("Node"), fields("Cell"))
