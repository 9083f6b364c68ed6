"""All errors and warnings of the code with the pattern of their messages, read from the sources."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from sources import ROOT

from tawami.base import errors

PACKAGE = ROOT / "python" / "tawami"
#: Headings of the list, and the rooms whose messages they hold.
SUBJECTS: dict[str, tuple[str, ...]] = {
    "Inputs, installation and ranks": ("base", "fem"),
    "Grid and body": ("grid", "border", "body"),
    "Forms": ("form", "check"),
    "Particles and laws": ("particles", "rust"),
    "Supports and fields": ("field",),
    "Solving": ("solve",),
    "Scene": ("domain", "conditions", "quantities", "step", "estimate", "scene"),
    "Steps and motion": ("motion",),
    "Results": ("picture", "results"),
    "Studies": ("study",),
    "Command line": ("command",),
}
#: Classes of errors and warnings that users see.
KINDS = {*errors.__all__, "InvertedError"}


@dataclass(frozen=True)
class Message:
    """A message of the code.

    Attributes:
        kind: Class of the exception or warning.
        says: The text, with expressions in angle brackets.
        file: Path from the top of the repository.
    """

    kind: str
    says: str
    file: str


def collected() -> list[Message]:
    """All messages that a user may see."""
    found: list[Message] = []
    for path in sorted(PACKAGE.rglob("*.py")):
        name = str(path.relative_to(ROOT))
        for kind, says in _of_module(ast.parse(path.read_text())):
            if kind in KINDS:
                found.append(Message(kind, says, name))
    # a pattern without text only passes on a message that is collected elsewhere
    with_text = {m.kind for m in found if _letters(m.says) > 12}
    useful = [m for m in found if _letters(m.says) > 12 or m.kind not in with_text]
    return list(dict.fromkeys([*useful, *_of_rust()]))


def _letters(pattern: str) -> int:
    """Number of letters of a pattern without its expressions."""
    return len(re.sub(r"<.*?>", "", pattern))


def _of_module(tree: ast.Module) -> Iterator[tuple[str, str]]:
    """Class and pattern of the errors that a module raises, and of its warnings."""
    fails = _kind_of_fail(tree)
    for node in ast.walk(tree):
        if isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call) and node.exc.args:
            yield ast.unparse(node.exc.func), _pattern(_text(tree, node.exc.args[0]))
        elif isinstance(node, ast.Return) and isinstance(node.value, ast.Call) and node.value.args:
            call = node.value  # an error that the caller raises
            yield ast.unparse(call.func), _pattern(call.args[0])
        elif isinstance(node, ast.Call) and node.args:
            called = ast.unparse(node.func)
            if called in ("warn", "warnings.warn"):
                kind = ast.unparse(node.args[1]) if len(node.args) > 1 else "UserWarning"
                yield kind, _pattern(_text(tree, node.args[0]))
            elif called == "self._fail" and fails:
                yield fails, _pattern(node.args[-1])
        elif isinstance(node, ast.FunctionDef) and node.name == "unsettled":
            for inner in ast.walk(node):  # a message of Newton's method
                if isinstance(inner, ast.Return) and inner.value is not None:
                    yield "ConvergenceError", _pattern(inner.value)


def _text(tree: ast.Module, node: ast.expr) -> ast.expr:
    """The text that was last assigned to a name before its use; other expressions as they are."""
    found = [
        (one.lineno, one.value)
        for one in ast.walk(tree)
        if isinstance(node, ast.Name) and isinstance(one, ast.Assign) and one.lineno < node.lineno
        if isinstance(one.value, ast.JoinedStr)
        if isinstance(one.targets[0], ast.Name) and one.targets[0].id == node.id
    ]
    return max(found, key=lambda pair: pair[0])[1] if found else node


def _kind_of_fail(tree: ast.Module) -> str:
    """Class of the error that a method `_fail` of the module raises."""
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef) and node.name == "_fail":
            for inner in ast.walk(node):
                if isinstance(inner, ast.Raise) and isinstance(inner.exc, ast.Call):
                    return ast.unparse(inner.exc.func)
    return ""


def _pattern(node: ast.expr) -> str:
    """Pattern of a message, with its expressions in angle brackets."""
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
    """Messages of the Rust part: `#[error(...)]`, and the expected values of parameters."""
    for path in sorted((ROOT / "rust").rglob("*.rs")):
        text, file = path.read_text(), str(path.relative_to(ROOT))
        for says in re.findall(r'#\[error\(\s*"((?:[^"\\]|\\.)*)"\s*\)\]', text, flags=re.DOTALL):
            message = re.sub(r"\\\n\s*", "", says)
            kind = "InvertedError" if "inside out" in message else "InputError"
            yield Message(kind, re.sub(r"\{(\w+)(:\?)?\}", r"<\1>", message), file)
        for name, expected in _parameters(text):
            yield Message("InputError", f"{name} = <value>: expected {expected}", file)


def _parameters(text: str) -> Iterator[tuple[str, str]]:
    """Name of each parameter that a law checks, and the expected values."""
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
    """Heading of the messages of a file.

    Raises:
        KeyError: The file is in no room.
    """
    room = "rust" if file.startswith("rust/") else Path(file).parts[2]
    return {room: title for title, rooms in SUBJECTS.items() for room in rooms}[room]


def plain(text: str) -> str:
    """Text with the special characters of Markdown escaped."""
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
