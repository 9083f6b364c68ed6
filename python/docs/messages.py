"""Every error and warning of the code with the pattern of its sentence, found in the sources."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from sources import ROOT

PACKAGE = ROOT / "python" / "tawami"
#: Subject of the modules; others stand under their own name.
SUBJECTS: dict[str, tuple[str, ...]] = {
    "Installation and ranks": ("_dolfinx", "ranks", "environment", "provenance"),
    "Grid and body": ("grid", "body", "placement", "quadrature", "level_set", "mesh", "geometry"),
    "Forms": ("formulation", "symbols", "density", "compilation", "ghost", "attached"),
    "Materials": ("materials", "numpy_law", "rust/material"),
    "Scene and inputs": ("scene", "inputs", "numerics", "contents", "initial", "rust/error.rs"),
    "Supports and loads": ("supports", "boundary", "reduction", "loads", "wall"),
    "Solving": ("newton", "linear", "krylov", "singularity", "solver", "field", "fast_field"),
    "Steps and motion": ("stepping", "dynamics", "energy", "inertia"),
    "Results": ("solution", "output", "results", "checkpoint", "checkpoints", "plot", "log"),
    "Command line": ("command_line",),
    "Studies": ("study",),
}
INTERNAL = ("RuntimeError", "NotImplementedError", "ValueError", "SystemExit", "TypeError")


@dataclass(frozen=True)
class Message:
    """A sentence of the code.

    Attributes:
        kind: Class of the exception or warning.
        says: The sentence; what is filled in stands between angle brackets.
        file: Where, from the top of the repository.
    """

    kind: str
    says: str
    file: str


def collected() -> list[Message]:
    """Every message that a user may meet."""
    found: list[Message] = []
    for path in sorted(PACKAGE.rglob("*.py")):
        name = str(path.relative_to(ROOT))
        for kind, says in _of_module(ast.parse(path.read_text())):
            if kind not in INTERNAL:
                found.append(Message(kind, says, name))
    # of a class with sentences of its own, what is handed on from elsewhere says nothing
    spoken = {m.kind for m in found if _letters(m.says) > 12}
    kept = [m for m in found if _letters(m.says) > 12 or m.kind not in spoken]
    return list(dict.fromkeys([*kept, *_of_rust()]))


def _letters(pattern: str) -> int:
    """Of a sentence, without what is filled in."""
    return len(re.sub(r"<.*?>", "", pattern))


def _of_module(tree: ast.Module) -> Iterator[tuple[str, str]]:
    """Class and sentence of what a module raises, and of its warnings."""
    fails = _kind_of_fail(tree)
    for node in ast.walk(tree):
        if isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call) and node.exc.args:
            kind = ast.unparse(node.exc.func)
            if kind.isidentifier():
                yield kind, _pattern(node.exc.args[0])
        elif isinstance(node, ast.Call) and node.args:
            called = ast.unparse(node.func)
            if called in ("warn", "warnings.warn"):
                kind = ast.unparse(node.args[1]) if len(node.args) > 1 else "UserWarning"
                yield kind, _pattern(node.args[0])
            elif called == "self._fail" and fails:
                yield fails, _pattern(node.args[-1])


def _kind_of_fail(tree: ast.Module) -> str:
    """What a method `_fail` of the module raises."""
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef) and node.name == "_fail":
            for inner in ast.walk(node):
                if isinstance(inner, ast.Raise) and isinstance(inner.exc, ast.Call):
                    return ast.unparse(inner.exc.func)
    return ""


def _pattern(node: ast.expr) -> str:
    """A sentence with its expressions in angle brackets."""
    if isinstance(node, ast.Constant):
        return str(node.value)
    if isinstance(node, ast.JoinedStr):
        return "".join(_pattern(part) for part in node.values)
    if isinstance(node, ast.FormattedValue):
        return f"<{ast.unparse(node.value)}>"
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add):
        return _pattern(node.left) + _pattern(node.right)
    return f"<{ast.unparse(node)}>"


def _of_rust() -> Iterator[Message]:
    """What the compiled part says: `#[error(...)]`, and what it expects of parameters."""
    text = (ROOT / "rust" / "error.rs").read_text()
    for says in re.findall(r'#\[error\(\s*"((?:[^"\\]|\\.)*)"\s*\)\]', text, flags=re.DOTALL):
        sentence = re.sub(r"\\\n\s*", "", says)
        kind = "InvertedError" if "inside out" in sentence else "InputError"
        yield Message(kind, re.sub(r"\{(\w+)(:\?)?\}", r"<\1>", sentence), "rust/error.rs")
    for path in sorted((ROOT / "rust" / "material").glob("*.rs")):
        file = str(path.relative_to(ROOT))
        for name, expected in _parameters(path.read_text()):
            yield Message("InputError", f"{name} = <value>: expected {expected}", file)


def _parameters(text: str) -> Iterator[tuple[str, str]]:
    """Name of each parameter that a law refuses, and what it expects."""
    string = r'"((?:[^"\\]|\\.)*)"'
    yield from re.findall(rf'name: "(\w+)",\s*value: \w+,\s*expected: {string}', text)
    for expected in re.findall(rf"\{{ name, value, expected: {string}", text):
        yield "<name>", expected
    for name, argument in re.findall(r'refuse\(\s*"(\w+)",\s*\w+,\s*(expected|"[^"]*")', text):
        if argument != "expected":
            yield name, argument.strip('"')
    for expected, name in re.findall(rf'let expected = {string};\s*return [^"]*"(\w+)"', text):
        yield name, expected


def subject(file: str) -> str:
    """Under which heading the messages of a file stand."""
    path = Path(file)
    if file.startswith("rust/"):
        keys = {"rust/error.rs", "rust/material"} & {file, str(path.parent)}
    else:
        keys = {path.relative_to("python/tawami").parts[0].removesuffix(".py")}
    for title, modules in SUBJECTS.items():
        if keys & set(modules):
            return title
    return path.stem.replace("_", " ").capitalize()


def plain(text: str) -> str:
    """Text that Markdown leaves as it is."""
    return re.sub(r"([\\`*_{}\[\]<>()#+.!|$~&^:-])", r"\\\1", text.replace("\n", " "))


def listing() -> str:
    """All messages by subject, as Markdown."""
    groups: dict[str, list[Message]] = {title: [] for title in SUBJECTS}
    for message in collected():
        groups.setdefault(subject(message.file), []).append(message)
    sections = []
    for title, messages in groups.items():
        if messages:
            rows = [f"- `{m.kind}`: {plain(m.says)}" for m in messages]
            sections.append(f"### {title}\n\n" + "\n".join(dict.fromkeys(rows)))
    return "\n\n".join(sections) + "\n"
