"""Differential operators that a residual takes from UFL instead of asking for them."""

from __future__ import annotations

import dis
import types
from collections.abc import Callable, Iterator
from typing import Any

import ufl

#: Operators that depend on the geometry, and the name of a residual that stands for them.
INSTEAD = {"grad": "grad", "nabla_grad": "grad", "div": "div", "nabla_div": "div", "Identity": "I"}


def from_ufl(residual: Callable[..., Any]) -> list[tuple[str, str, int]]:
    """Operators of UFL in a residual and in the functions that it calls.

    Returns:
        Name, the name to ask for instead, and the first line.
    """
    found = dict[str, int]()
    for function in _functions(residual):
        line = function.__code__.co_firstlineno
        before: Any = None
        for instruction in dis.get_instructions(function):
            line = instruction.starts_line or line
            name, value = instruction.argval, None
            if instruction.opname == "LOAD_GLOBAL":
                value = function.__globals__.get(name)
            elif instruction.opname == "LOAD_DEREF":
                value = _cell(function, name)
            elif instruction.opname in ("LOAD_ATTR", "LOAD_METHOD") and before is ufl:
                value = getattr(ufl, name, None)
            for operator in INSTEAD:
                if value is getattr(ufl, operator):
                    found.setdefault(operator, line)
            before = value
    return [(operator, INSTEAD[operator], line) for operator, line in found.items()]


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
