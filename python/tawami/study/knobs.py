"""Knobs of a function: arguments with a default and a list of values from coarse to fine.

Values in a set are equally accurate repetitions, as shifts of the grid.
"""

from __future__ import annotations

import ast
import inspect
import typing
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

from tawami.base import checks
from tawami.base.errors import InputError
from tawami.base.text import meant
from tawami.study.process import Run
from tawami.study.row import value_text
from tawami.study.series import is_list, knob_values

#: Example for messages.
EXAMPLE = "as h: Annotated[float, (1/4, 1/8, 1/16)] = 1/8"


@dataclass(frozen=True)
class Knob:
    """An argument of a function.

    Attributes:
        name: Of the argument.
        values: Its values, from coarse to fine; alternatives in any order if they are not numbers.
        default: One of them.
        repeats: Whether the values are equally accurate, as shifts of the grid, so that their spread
            measures the noise.
    """

    name: str
    values: tuple[Any, ...]
    default: Any
    repeats: bool = False

    @property
    def refines(self) -> bool:
        """Whether the values are positive numbers in order, so that they may have a limit."""
        return not self.repeats and is_ladder(self.values)


def is_ladder(values: Sequence[Any]) -> bool:
    """Whether values are positive numbers that only grow or only decrease."""
    if any(isinstance(v, bool) or not isinstance(v, int | float) or v <= 0 for v in values):
        return False
    steps = [b - a for a, b in pairwise(values)]
    return all(step > 0 for step in steps) or all(step < 0 for step in steps)


def knobs_of(build: Run, declared: Mapping[str, Sequence[Any]] | None = None) -> list[Knob]:
    """Knobs of a function.

    Args:
        build: Function of which every argument has a default.
        declared: Values of its knobs by name, instead of annotations.

    Raises:
        InputError: An argument without a default, an unknown knob, or no knob.
    """
    name = getattr(build, "__name__", checks.shown(build))
    parameters = inspect.signature(build).parameters
    if declared is not None and not isinstance(declared, Mapping):
        raise InputError(
            f"knobs = {checks.shown(declared)}: expected a mapping from names of arguments to values"
        )
    ranges = _annotated(build) | dict(declared or {})
    for parameter in parameters.values():
        if parameter.default is parameter.empty:
            raise InputError(f"argument '{parameter.name}' of {name} has no default: expected one")
    for knob in ranges:
        if knob not in parameters:
            raise InputError(
                f"knob '{knob}': expected an argument of {name}{meant(knob, parameters)}"
            )
    if not ranges:
        raise InputError(
            f"{name} has no knobs: expected an argument with its values from coarse to fine, {EXAMPLE}"
        )
    knobs = [_knob(knob, values, parameters[knob].default) for knob, values in ranges.items()]
    if not any(knob.refines for knob in knobs):
        raise InputError(
            f"no knob of {name} refines: expected one with positive numbers from coarse to fine, "
            f"{EXAMPLE}"
        )
    return knobs


def _annotated(build: Run) -> dict[str, Any]:
    """Values in annotations by name."""
    try:
        hints = typing.get_type_hints(build, include_extras=True)
    except (NameError, TypeError) as error:
        raise InputError(f"annotations cannot be read: {error}") from error
    found = {name: getattr(hint, "__metadata__", ()) for name, hint in hints.items()}
    lists = {
        name: [m for m in metadata if is_list(m) or _is_set(m) or isinstance(m, int | float)]
        for name, metadata in found.items()
    }
    return {name: metadata[0] for name, metadata in lists.items() if metadata}


def _is_set(values: Any) -> bool:
    return isinstance(values, set | frozenset)


def _knob(name: str, values: Any, default: Any) -> Knob:
    repeats = _is_set(values)
    if isinstance(values, int | float):
        raise InputError(
            f"knob '{name}' = {checks.shown(values)}: expected its values from coarse to fine, {EXAMPLE}"
        )
    if repeats:
        values = sorted({*values, default}, key=lambda v: (v != default, repr(v)))
    listed = list(dict.fromkeys(knob_values(name, values)))
    if default not in listed:
        listed = _with_default(name, listed, default)
    if len(listed) < 2:
        raise InputError(
            f"knob '{name}' = {checks.shown(values)}: expected at least two values, {EXAMPLE}"
        )
    return Knob(name, tuple(listed), default, repeats)


def _with_default(name: str, values: list[Any], default: Any) -> list[Any]:
    """The values with the default in its place."""
    knob_values(name, [default])
    places = [[*values[:k], default, *values[k:]] for k in range(len(values) + 1)]
    return next(filter(is_ladder, places), [*values, default])


def applied(source: str, function: str, setting: Mapping[str, Any]) -> str:
    """Source with other defaults of the arguments of a function.

    Args:
        source: Of a script.
        function: Name of a function in it.
        setting: New defaults.
    """
    lines = source.encode().splitlines(keepends=True)
    places = list[tuple[ast.expr, Any]]()
    for node in ast.parse(source).body:
        if isinstance(node, ast.FunctionDef) and node.name == function:
            positional = [*node.args.posonlyargs, *node.args.args]
            used = positional[len(positional) - len(node.args.defaults) :]
            pairs = [*zip(used, node.args.defaults, strict=True)]
            pairs += zip(node.args.kwonlyargs, node.args.kw_defaults, strict=True)  # type: ignore[arg-type]
            places = [(default, setting[a.arg]) for a, default in pairs if a.arg in setting]
    for old, value in sorted(places, key=lambda p: (p[0].lineno, p[0].col_offset), reverse=True):
        assert old.end_lineno is not None
        assert old.end_col_offset is not None
        first, last = old.lineno - 1, old.end_lineno - 1
        head, tail = lines[first][: old.col_offset], lines[last][old.end_col_offset :]
        lines[first : last + 1] = [head + repr(value).encode() + tail]
    return b"".join(lines).decode()


def write_applied(script: Path, setting: Mapping[str, Any], tolerance: float) -> Path:
    """Write a copy of a script with a setting as the defaults of its function `build`.

    Raises:
        InputError: The copy exists.
    """
    path = script.with_name(f"{script.stem}_{value_text(100 * tolerance)}_percent.py")
    if path.exists():
        raise InputError(f"'{path}' exists: expected no file there; remove or rename it")
    path.write_text(applied(script.read_text(encoding="utf-8"), "build", setting), encoding="utf-8")
    return path
