"""Nodes and elements with numbers, as text files list them, as a mesh of meshio."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from tawami.base.checks import shown
from tawami.base.errors import InputError

#: Types of plane elements in meshio, by their number of nodes.
PLANE = {3: "triangle", 4: "quad", 6: "triangle6", 8: "quad8", 9: "quad9"}


class Numbered:
    """A file while it is read.

    Attributes:
        nodes: Position (x, y, z) [m] of each node.
        elements: Nodes of each element, by type of meshio and number.
        sets: Numbers of the elements of each set.
        lines: Nodes of each line of the border, by number.
        line_sets: Numbers of the lines of each set.
        node_sets: Numbers of the nodes of each set.
        line: Number of the line that is read.

    Args:
        file: Its path, for error messages.
    """

    def __init__(self, file: Path) -> None:
        self.file = file
        self.nodes: dict[int, list[float]] = {}
        self.elements: dict[str, dict[int, list[int]]] = {}
        self.sets: dict[str, list[int]] = {}
        self.lines: dict[int, list[int]] = {}
        self.line_sets: dict[str, list[int]] = {}
        self.node_sets: dict[str, list[int]] = {}
        self.line = 0

    def fail(self, what: str) -> NoReturn:
        """Raise an error that names file and line."""
        raise InputError(f"mesh: '{self.file}', line {self.line}: {what}")

    def numbers(self, words: Iterable[str], kind: type[int] | type[float]) -> list[Any]:
        """Words as numbers.

        Raises:
            InputError: One is not a number.
        """
        words = list(words)
        try:
            return [kind(word) for word in words]
        except ValueError:
            what = "whole numbers" if kind is int else "numbers"
            self.fail(f"{shown(' '.join(words))}: expected {what}")

    def add_node(self, words: list[str]) -> None:
        """A node: its number and two or three coordinates.

        Raises:
            InputError: Another node has the same number, or there are more or fewer numbers.
        """
        if not 3 <= len(words) <= 4:
            self.fail(f"{shown(' '.join(words))}: expected a node, its number and x, y, z")
        (number,), place = self.numbers(words[:1], int), self.numbers(words[1:], float)
        place += [0.0] * (3 - len(place))
        if self.nodes.setdefault(number, place) != place:
            self.fail(
                f"node {number} is listed twice, at different places: expected each number once; "
                "write all parts as one"
            )

    def add_element(self, kind: str, number: int, nodes: list[int]) -> None:
        """An element of a type of meshio.

        Raises:
            InputError: Another element has the same number.
        """
        same = self.elements.setdefault(kind, {})
        if same.setdefault(number, nodes) is not nodes:
            self.fail(f"element {number} is listed twice: expected each number once")

    def mesh(self) -> Any:
        """The mesh, with the sets of elements and lines as cell sets, and those of nodes as point sets.

        Raises:
            InputError: An element has a node that the file does not have.
        """
        import meshio

        place = {number: k for k, number in enumerate(self.nodes)}
        blocks = [*self.elements.items(), *([("line", self.lines)] if self.lines else [])]
        for kind, elements in blocks:
            for number, of in elements.items():
                missing = [node for node in of if node not in place]
                if missing:
                    what = "line" if kind == "line" else "element"
                    raise InputError(
                        f"mesh: '{self.file}': {what} {number} has node {missing[0]}, which is not in "
                        "the file: expected all nodes of the elements and lines"
                    )
        cells = [
            (kind, np.array([[place[node] for node in of] for of in elements.values()]))
            for kind, elements in blocks
        ]
        sets = {
            name: [
                _places((self.line_sets if kind == "line" else self.sets).get(name, ()), elements)
                for kind, elements in blocks
            ]
            for name in (*self.sets, *(name for name in self.line_sets if name not in self.sets))
        }
        points = {name: _places(numbers, place) for name, numbers in self.node_sets.items()}
        x = np.array([*self.nodes.values()]).reshape(-1, 3)
        return meshio.Mesh(x, cells, cell_sets=sets, point_sets=points)


def _places(numbers: Iterable[int], known: Iterable[int]) -> Any:
    """Places among the known numbers of those that are known."""
    place = {number: k for k, number in enumerate(known)}
    return np.array([place[n] for n in numbers if n in place], dtype=np.int64)
