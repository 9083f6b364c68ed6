"""Model parts of Kratos (.mdpa): nodes, plane elements and submodel parts.

meshio takes most elements of Kratos for lines, and ignores properties and submodel parts.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from tawami.body.numbered import PLANE, Numbered


def read(file: Path) -> Any:
    """A mesh of meshio; its cell sets are the submodel parts, or else the numbers of the properties.

    A submodel part has the elements and conditions of the parts inside it. Conditions with two or three
    nodes are lines of the border.

    Raises:
        InputError: The file has elements or lines that are not read.
    """
    found = _File(file)
    for found.line, text in enumerate(file.read_text(errors="replace").splitlines(), 1):
        words = text.partition("//")[0].split()
        if words[:1] == ["Begin"]:
            found.open.append(words[1:])
        elif words[:1] == ["End"]:
            found.close(words[1:])
        elif words and found.open:
            found.add(words)
    if found.open:
        found.fail(
            f"the file ends inside of {' '.join(found.open[-1])}: expected the end of this block"
        )
    if not any(found.sets.values()) and len(found.of_property) > 1:
        found.sets = found.of_property
    return found.mesh()


class _File(Numbered):
    """A file of Kratos while it is read."""

    def __init__(self, file: Path) -> None:
        super().__init__(file)
        self.open: list[list[str]] = []
        self.of_property: dict[str, list[int]] = {}

    def close(self, words: list[str]) -> None:
        """The end of a block."""
        if not self.open or self.open[-1][:1] != words[:1]:
            self.fail(f"End {' '.join(words)}: expected the end of the block that began last")
        self.open.pop()

    def add(self, words: list[str]) -> None:
        """A line in the block that began last."""
        block, *name = self.open[-1]
        if block == "Nodes":
            self.add_node(words)
        elif block == "Elements":
            self._add_element("".join(name), words)
        elif block == "Conditions":
            self._add_condition("".join(name), words)
        elif block in ("SubModelPartElements", "SubModelPartConditions"):
            sets = self.sets if block == "SubModelPartElements" else self.line_sets
            for part in (part[1] for part in self.open if part[0] == "SubModelPart" and part[1:]):
                sets.setdefault(part, []).extend(self.numbers(words, int))

    def _add_condition(self, name: str, words: list[str]) -> None:
        number, _, *nodes = self.numbers(words, int)
        if len(nodes) == 2 or (len(nodes) == 3 and "2D" in name):
            self.lines[number] = nodes[:2]

    def _add_element(self, name: str, words: list[str]) -> None:
        number, properties, *nodes = self.numbers(words, int)
        space = re.search(r"([23])D", name)
        solid = space is not None and space.group(1) == "3"
        flat = re.search("Shell|Membrane|Triangle|Quadrilateral|3D3N|3D6N", name)
        if len(nodes) <= 2 or "Line" in name:
            return
        if (solid and not flat) or len(nodes) not in PLANE:
            self.fail(
                f"element {number} is a {name} with {len(nodes)} nodes: expected plane elements with "
                f"{', '.join(map(str, PLANE))} nodes (lines and points are ignored)"
            )
        self.add_element(PLANE[len(nodes)], number, nodes)
        self.of_property.setdefault(str(properties), []).append(number)
