"""The rooms of the package, read from the source: who imports whom, and how large things are."""

from __future__ import annotations

import ast
import graphlib
from collections.abc import Iterator
from pathlib import Path

import pytest

import tawami

PACKAGE = Path(tawami.__file__).parent
#: Rooms from the lowest to the highest; rooms on one line do not know each other.
LEVELS = (
    ("base",),
    ("fem", "picture"),
    ("grid", "form"),
    ("border",),
    ("body",),
    ("particles",),
    ("field",),
    ("solve",),
    ("domain",),
    ("conditions", "quantities"),
    ("step",),
    ("estimate",),
    ("scene",),
    ("motion", "check"),
    ("results",),
    ("study",),
    ("command",),
)
LEVEL = {room: level for level, rooms in enumerate(LEVELS) for room in rooms}
MODULES = {
    path.relative_to(PACKAGE).with_suffix("").parts: path
    for path in sorted(PACKAGE.rglob("*.py"))
    if not {"forms", "templates"} & set(path.parts)
}
TREES = {name: ast.parse(path.read_text(encoding="utf-8")) for name, path in MODULES.items()}
IN_ROOMS = [name for name in MODULES if len(name) > 1]


def module(name: tuple[str, ...]) -> tuple[str, ...]:
    """The module that a dotted name belongs to; of a package, its `__init__`."""
    for end in range(len(name), 0, -1):
        if name[:end] in MODULES:
            return name[:end]
        if (*name[:end], "__init__") in MODULES:
            return (*name[:end], "__init__")
    return name


def imports(name: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], str]]:
    """Every import from the package: the module and the imported name, under TYPE_CHECKING too."""
    for node in ast.walk(TREES[name]):
        if isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{name}: a relative import"
            parts = (node.module or "").split(".")
            if parts[0] == "tawami":
                for alias in node.names:
                    yield module((*parts[1:], alias.name)), alias.name
        elif isinstance(node, ast.Import):
            for alias in node.names:
                assert alias.name.split(".")[0] != "tawami", f"{name} imports {alias.name}"


def test_every_module_is_in_a_room():
    flat = {name[0] for name in MODULES if len(name) == 1}
    assert flat == {"__init__", "__main__"}
    assert {name[0] for name in IN_ROOMS} == set(LEVEL)


@pytest.mark.parametrize("name", IN_ROOMS, ids="/".join)
def test_a_module_imports_only_rooms_below_its_own(name):
    for target, _ in imports(name):
        room = target[0]
        assert room == name[0] or room == "_rust" or LEVEL[room] < LEVEL[name[0]], (
            f"{'/'.join(name)} imports {'/'.join(target)}, which is not below it"
        )


def test_modules_do_not_import_each_other_in_a_circle():
    graph = {name: {target for target, _ in imports(name)} - {name} for name in IN_ROOMS}
    # a package's __init__ re-exports the names of its room, which modules of the room do not use
    for name in IN_ROOMS:
        graph[name] = {t for t in graph[name] if not (t[-1] == "__init__" and t[0] == name[0])}
    tuple(graphlib.TopologicalSorter(graph).static_order())


@pytest.mark.parametrize("name", IN_ROOMS, ids="/".join)
def test_a_module_uses_no_private_name_of_another(name):
    for target, imported in imports(name):
        private = imported.startswith("_") and imported not in ("_rust", "__version__")
        assert not private, f"{'/'.join(name)} imports {imported} of {'/'.join(target)}"
    if name[0] == "fem":  # versions of dolfinx differ in private names
        return
    own = private_names(TREES[name])
    for node in ast.walk(TREES[name]):
        if isinstance(node, ast.Attribute) and node.attr.startswith("_"):
            known = node.attr.startswith("__") or node.attr in own
            assert known, f"{'/'.join(name)}:{node.lineno} reaches {ast.unparse(node)}"


def private_names(tree: ast.Module) -> set[str]:
    """Names with an underscore that a module defines."""
    names = {"_rust", "_exit", "_getframe"}  # of os and of sys
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            names.add(node.name)
        elif isinstance(node, ast.Name):
            names.add(node.id)
        elif isinstance(node, ast.Attribute) and ast.unparse(node.value) in ("self", "cls"):
            names.add(node.attr)
    return names


def test_only_fem_imports_dolfinx():
    for name in IN_ROOMS:
        for node in ast.walk(TREES[name]):
            if isinstance(node, ast.Import):
                roots = {alias.name.split(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                roots = {(node.module or "").split(".")[0]}
            else:
                continue
            assert name[0] == "fem" or not roots & {"dolfinx", "basix", "ffcx"}, "/".join(name)


def test_the_face_defines_nothing():
    for node in ast.parse((PACKAGE / "__init__.pyi").read_text(encoding="utf-8")).body:
        docstring = isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
        public = isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__all__"
        assert docstring or public or isinstance(node, ast.ImportFrom), ast.unparse(node)
    for node in TREES[("__init__",)].body:  # which imports these names when they are used
        docstring = isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
        assert docstring or ast.unparse(node) in (
            "from tawami.base.lazy import attach",
            "__getattr__, __dir__, __all__ = attach(__name__, __file__)",
        )


#: Most lines of a file, of the code of a class and of a function; docstrings count in files only.
FILE, CLASS, FUNCTION = 350, 250, 60
#: Files that may be longer, and why.
LONGER = {
    ("scene", "scene"): "the public face of the package: two lines in three are documentation"
}


@pytest.mark.parametrize("name", IN_ROOMS, ids="/".join)
def test_files_classes_and_functions_are_short(name):
    lines = MODULES[name].read_text(encoding="utf-8").count("\n")
    assert lines <= FILE or name in LONGER, f"{lines} lines"
    for node in ast.walk(TREES[name]):
        if isinstance(node, ast.ClassDef | ast.FunctionDef):
            lines = lines_of_code(node)
            most = CLASS if isinstance(node, ast.ClassDef) else FUNCTION
            assert lines <= most, f"{node.name} has {lines} lines of code"


def lines_of_code(node: ast.ClassDef | ast.FunctionDef) -> int:
    """Lines of a class or function without the docstrings in it."""
    assert node.end_lineno is not None
    lines = node.end_lineno - node.lineno + 1
    for inner in ast.walk(node):
        if isinstance(inner, ast.ClassDef | ast.FunctionDef):
            docstring = ast.get_docstring(inner, clean=False)
            lines -= len(docstring.splitlines()) if docstring else 0
    return lines
