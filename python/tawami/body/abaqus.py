"""Input files of Abaqus: nodes, plane elements and element sets.

meshio does not know plane strain elements, and assigns a set of two types of elements wrongly.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from tawami.body.numbered import PLANE, Numbered

#: Plane elements, and shells and membranes, which may lie in a plane; the digit counts their nodes.
USED = re.compile(r"(?:CPEG?|CPS|CAX|DC2D|DCAX|AC2D|M3D|SFM3D|R3D|STRI|DS|S)([34689])")
#: Elements that are ignored: trusses, beams, springs, masses, connectors and rigid lines.
IGNORED = re.compile(r"T[23]D|B[23][123]|PIPE|FRAME|SPRING|DASHPOT|MASS|ROTARYI|CONN|R2D|RAX")
#: Keywords that make nodes or elements by rules, or elsewhere.
RULES = ("NGEN", "NFILL", "NCOPY", "NMAP", "ELGEN", "ELCOPY", "SYSTEM", "INCLUDE")


def read(file: Path) -> Any:
    """A mesh of meshio; its cell sets are the element sets, its point sets the node sets.

    Raises:
        InputError: The file has elements, keywords or lines that are not read.
    """
    found = _File(file)
    text = file.read_text(errors="replace").splitlines()
    for found.line, keyword, options, rows in _sections(text):
        found.add(keyword, options, rows)
    return found.mesh()


def _sections(text: list[str]) -> Iterator[tuple[int, str, dict[str, str], list[list[str]]]]:
    """Line, keyword, parameters and data lines of each section; a comma at the end continues a line."""
    lines = [(k, line.strip()) for k, line in enumerate(text, 1)]
    lines = [(k, line) for k, line in lines if line and not line.startswith("**")]
    joined = list[tuple[int, str]]()
    for k, line in lines:
        if joined and joined[-1][1].endswith(",") and not line.startswith("*"):
            joined[-1] = (joined[-1][0], joined[-1][1] + line)
        else:
            joined.append((k, line))
    starts = [k for k, (_, line) in enumerate(joined) if line.startswith("*")]
    for start, end in zip(starts, [*starts[1:], len(joined)], strict=bool(starts)):
        number, head = joined[start]
        keyword, *given = (word.strip() for word in head[1:].split(","))
        options = {
            key.strip().upper(): v.strip(' "') for key, _, v in (g.partition("=") for g in given)
        }
        rows = [
            [w.strip() for w in line.split(",") if w.strip()] for _, line in joined[start + 1 : end]
        ]
        yield number, keyword.upper(), options, rows


class _File(Numbered):
    """A file of Abaqus while it is read."""

    def add(self, keyword: str, options: dict[str, str], rows: list[list[str]]) -> None:
        """A keyword with its parameters and data lines."""
        if keyword in RULES or (keyword in ("NODE", "ELEMENT") and "INPUT" in options):
            self.fail(
                f"*{keyword} with nodes or elements that this file does not list: expected all of them "
                "in *NODE and *ELEMENT"
            )
        if keyword == "INSTANCE" and rows:
            self.fail(
                "*INSTANCE moves its part: expected nodes where the body is; move them in *NODE"
            )
        if keyword == "NODE":
            for row in rows:
                self.add_node(row)
        elif keyword == "ELEMENT":
            self._add_elements(options, rows)
        elif keyword == "ELSET":
            self._add_set(self.sets, options.get("ELSET", ""), options, rows)
        elif keyword == "NSET":
            self._add_set(self.node_sets, options.get("NSET", ""), options, rows)

    def _add_elements(self, options: dict[str, str], rows: list[list[str]]) -> None:
        kind = options.get("TYPE", "")
        if IGNORED.match(kind.upper()):
            return
        used = USED.match(kind.upper())
        if used is None:
            self.fail(
                f"element type '{kind}': expected plane elements, such as CPE3, CPE4, CPE6 or CPE8 "
                "(trusses, beams and points are ignored)"
            )
        count = int(used.group(1))
        for row in rows:
            number, *nodes = self.numbers(row, int)
            if len(nodes) != count:
                self.fail(
                    f"element {number} of type {kind} has {len(nodes)} nodes: expected {count}"
                )
            self.add_element(PLANE[count], number, nodes)
            if "ELSET" in options:
                self._set(self.sets, options["ELSET"]).append(number)

    def _set(self, sets: dict[str, list[int]], name: str) -> list[int]:
        """The members of a set; upper and lower case are the same."""
        same = (known for known in sets if known.upper() == name.upper())
        return sets.setdefault(next(same, name), [])

    def _add_set(
        self, sets: dict[str, list[int]], name: str, options: dict[str, str], rows: list[list[str]]
    ) -> None:
        members = self._set(sets, name)
        for row in rows:
            if "GENERATE" in options:
                first, last, *step = self.numbers(row, int)
                members.extend(range(first, last + 1, *step))
                continue
            for word in row:
                if word.lstrip("-").isdigit():
                    members.append(int(word))
                else:
                    members.extend(self._set(sets, word.strip('"')))
