"""Lines of a function that name given objects, as `ufl.dx` or `grad` of UFL."""

from __future__ import annotations

import dis
import types
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import ufl


def first_lines(residual: Callable[..., Any], objects: Mapping[str, Any]) -> dict[str, int]:
    """The first line where a function, or a function of the same file that it calls, names an object.

    Args:
        residual: The function.
        objects: Objects by name.

    Returns:
        Name of each object that it names -> line.
    """
    found = dict[str, int]()
    for function in _functions(residual):
        line, before = function.__code__.co_firstlineno, None
        for instruction in dis.get_instructions(function):
            line = instruction.starts_line or line
            name, value = instruction.argval, None
            if instruction.opname == "LOAD_GLOBAL":
                value = function.__globals__.get(name)
            elif instruction.opname == "LOAD_DEREF":
                value = _cell(function, name)
            elif instruction.opname in ("LOAD_ATTR", "LOAD_METHOD") and before is ufl:
                value = getattr(ufl, name, None)
            for name, known in objects.items():
                if value is known:
                    found.setdefault(name, line)
            before = value
    return found


def _functions(residual: Callable[..., Any]) -> Iterator[types.FunctionType]:
    """A function, and the functions of the same file that it names."""
    waiting, seen = [residual], set[int]()
    while waiting:
        function = waiting.pop()
        if not isinstance(function, types.FunctionType) or id(function) in seen:
            continue
        seen.add(id(function))
        yield function
        code = function.__code__
        named = [function.__globals__.get(name) for name in code.co_names]
        named += [_cell(function, name) for name in code.co_freevars]
        waiting += [
            other
            for other in named
            if isinstance(other, types.FunctionType)
            and other.__code__.co_filename == code.co_filename
        ]


def _cell(function: types.FunctionType, name: str) -> Any:
    """Value of a name of an enclosing function."""
    places = dict(zip(function.__code__.co_freevars, function.__closure__ or (), strict=True))
    try:
        return places[name].cell_contents
    except (KeyError, ValueError):
        return None
