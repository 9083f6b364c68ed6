"""References of pages to files of the repository and symbols in them: `forms/u.py residual`."""

from __future__ import annotations

import ast
import os
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
#: A reference in a page.
ROLE = re.compile(r"\{src\}`([^`]+)`")


def repository(project: Path = ROOT / "pyproject.toml") -> str:
    """Address of the files of the repository: `repository` of the table [project.urls], or nothing."""
    urls = tomllib.loads(project.read_text())["project"].get("urls", {})
    found = {name.lower(): address for name, address in urls.items()}.get("repository", "")
    return f"{found.rstrip('/')}/blob/HEAD" if found else ""


def address(reference: str, base: str, page: Path) -> str:
    """Link to the file of a reference.

    Args:
        reference: As for `missing`.
        base: Address of the files; without one the link leads to the file in this checkout.
        page: Folder of the page with the link.
    """
    path = reference.partition(" ")[0]
    return f"{base}/{path}" if base else os.path.relpath(ROOT / path, page)


def missing(reference: str) -> str | None:
    """Error message of a reference, or None if it is right.

    Args:
        reference: Path from the top of the repository, and after a blank a symbol of the file:
            `Class.method` in Python, `Type::function` in Rust.
    """
    path, _, symbol = reference.partition(" ")
    file = ROOT / path
    if not file.exists():
        return f"'{path}' is not in the repository: expected the path of a file, or of a folder"
    if not symbol:
        return None
    if file.suffix == ".py":
        found = symbol in set(_names(ast.parse(file.read_text())))
    else:
        text = file.read_text()
        found = all(
            re.search(rf"\b(fn|struct|enum|trait|type|const) {re.escape(part)}\b", text)
            or re.search(rf"\bimpl\b[^{{]*\b{re.escape(part)}\b", text)
            for part in symbol.split("::")
        )
    return None if found else f"'{path}' has no '{symbol}': expected a name that it defines"


def _names(node: ast.AST, prefix: str = "") -> Iterator[str]:
    """Qualified names that a module defines."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.FunctionDef | ast.ClassDef):
            yield prefix + child.name
            yield from _names(child, f"{prefix}{child.name}.")
        elif isinstance(child, ast.Assign | ast.AnnAssign):
            targets = child.targets if isinstance(child, ast.Assign) else [child.target]
            yield from (prefix + t.id for t in targets if isinstance(t, ast.Name))
