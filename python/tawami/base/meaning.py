"""Facts about a function of a script, its code and the values that it reads, in the types of JSON.

A checkpoint stores this, so that a run is not resumed with another stiffness because a constant of the
script has changed. The facts are the byte code and that of nested functions, module variables that the
code names, attributes of modules (`settings.E`), closures, defaults, and the same of functions, methods
and objects among these values. Functions of installed packages are compared by name.
"""

from __future__ import annotations

import dis
import functools
import hashlib
import logging
import os
import sys
from collections.abc import Iterable, Iterator, Mapping
from pathlib import PurePath
from types import BuiltinFunctionType, CodeType, FunctionType, MethodType, ModuleType
from typing import Any

import numpy as np

#: Relative tolerance to which numbers of two identities are compared.
ALIKE = 1e-9
#: Round-off of values of size one.
ROUND_OFF = 1e-12
#: Keys of the facts about code, and of a value that cannot be compared.
CODE, PYTHON, UNKNOWN = "its code", "Python", "cannot be compared"
#: Depth of values in values up to which they are compared, and entries of an array that are shown.
DEEPEST, SHOWN = 12, 6
#: Flag of code with a docstring, since Python 3.14.
HAS_DOCSTRING = 0x4000000
#: Length from which a list of numbers is compared as an array.
LONG = 100


def fingerprint(values: Any, size: float) -> float:
    """A number that other values hardly share.

    `tawami.base.identity.same` compares it to the relative tolerance ALIKE: round-off in the values, and
    values that are only round-off of `size`, make no difference.
    """
    weights = np.random.default_rng(0).uniform(0.5, 1.5, values.shape)
    least = values.size * ROUND_OFF * size / ALIKE
    return float((weights * values + 2 * np.abs(values)).sum() + least)


def meaning(value: Any, inside: tuple[int, ...] = ()) -> Any:
    """A value in the types of JSON, equal for equal values; for functions, the facts about them.

    Args:
        value: Any value.
        inside: Identities of the values that it is part of.
    """
    if isinstance(value, np.generic):
        value = value.item()
    if value is None or isinstance(value, bool | int | float | str):
        return value
    if id(value) in inside or len(inside) > DEEPEST:
        return "a value that holds itself" if id(value) in inside else _unknown(value)
    inside = (*inside, id(value))
    if isinstance(value, np.ndarray) and value.dtype.kind in "biufc":
        return _array(value)
    if isinstance(value, list | tuple) and len(value) > LONG:
        array = np.array(value, dtype=object)
        if array.ndim == 1 and all(isinstance(item, int | float) for item in value):
            return _array(array.astype(float))
    if isinstance(value, list | tuple | np.ndarray):
        return [meaning(item, inside) for item in value]
    if isinstance(value, Mapping) and not isinstance(value, type(os.environ)):
        return {str(key): meaning(item, inside) for key, item in value.items()}
    if isinstance(value, set | frozenset):
        return sorted(map(repr, value))
    return _of_callable(value, inside) or _of_object(value, inside)


def _array(values: Any) -> dict[str, Any]:
    """Facts of an array of numbers; the first values for the message."""
    facts = {
        "type": f"array {values.dtype} {values.shape}",
        "first": values.ravel()[:SHOWN].tolist(),
    }
    if values.dtype.kind == "c":
        values, facts["first"] = np.stack([values.real, values.imag]), None
    finite = np.isfinite(values)
    facts["fingerprint"] = fingerprint(np.where(finite, values, 0).astype(float), 0.0)
    if not finite.all():
        other = np.where(finite, 0, values).astype(float)
        facts["not finite"] = hashlib.sha256(other.tobytes()).hexdigest()[:16]
    return facts


def _of_callable(value: Any, inside: tuple[int, ...]) -> Any:
    """Facts of a function, a method, a partial function, a module, a class; None for others."""
    if isinstance(value, functools.partial):
        parts = [value.func, value.args, value.keywords]
        return {"partial": [meaning(part, inside) for part in parts]}
    if isinstance(value, MethodType):
        return {
            value.__name__: meaning(value.__func__, inside), "self": meaning(value.__self__, inside)
        }  # fmt: skip
    if isinstance(value, ModuleType):
        return f"module {value.__name__}"
    inner = getattr(value, "__wrapped__", None) or getattr(value, "py_func", None)
    if inner is not None and callable(value):
        return meaning(inner, inside)
    if isinstance(value, BuiltinFunctionType | np.ufunc) or (
        isinstance(value, FunctionType | type) and len(inside) > 1 and _installed(value)
    ):
        return (
            f"{getattr(value, '__module__', '')}.{getattr(value, '__qualname__', value.__name__)}"
        )
    if isinstance(value, FunctionType):
        return {CODE: _code(value), **dict(_values(value, inside))}
    if isinstance(value, type):
        own = {name: item for name, item in vars(value).items() if not _is_of_python(name, item)}
        return {name: meaning(item, inside) for name, item in own.items()}
    return None


def _of_object(value: Any, inside: tuple[int, ...]) -> Any:
    """Facts of an object: its type, and its attributes or its text."""
    kind = type(value)
    if isinstance(value, logging.Logger):
        return repr(value.name)
    facts: dict[str, Any] = {"type": f"{kind.__module__}.{kind.__qualname__}"}
    package = kind.__module__.partition(".")[0]
    if package == "mpi4py" or (package == "tawami" and hasattr(kind, "state")):
        return facts  # the scene itself, whose facts are compared as those of the run
    if package == "tawami" and hasattr(kind, "identity"):
        return facts | {"identity": meaning(value.identity(), inside)}
    slots = [name for one in kind.__mro__ for name in _slots(one) if hasattr(value, name)]
    of_python = package in sys.stdlib_module_names and package != "__main__"
    if (hasattr(value, "__dict__") or slots) and not of_python:
        own = {name: getattr(value, name) for name in slots} | getattr(value, "__dict__", {})
        facts |= {name: meaning(item, inside) for name, item in own.items()}
        if not _installed(kind):
            facts["class"] = meaning(kind, inside)
        return facts
    text = repr(value)
    if isinstance(value, PurePath | bytes) or (" at 0x" not in text and not text.startswith("<")):
        return text
    return _unknown(value)


def _unknown(value: Any) -> dict[str, str]:
    return {UNKNOWN: f"{type(value).__module__}.{type(value).__qualname__}"}


def _slots(kind: type) -> Iterable[str]:
    given = vars(kind).get("__slots__", ())
    names = [given] if isinstance(given, str) else list(given)
    return [name for name in names if not name.startswith("__")]


def _is_of_python(name: str, item: Any) -> bool:
    """Whether Python made an entry of a class."""
    special = name.startswith("__") and not isinstance(item, FunctionType)
    return special or not (isinstance(item, FunctionType) or not hasattr(item, "__get__"))


def _installed(value: Any) -> bool:
    """Whether a function, class or module belongs to Python, to an installed package, or to tawami."""
    name = value.__name__ if isinstance(value, ModuleType) else value.__module__ or ""
    file = getattr(sys.modules.get(name), "__file__", None)
    if name.partition(".")[0] in {*sys.stdlib_module_names, "tawami"} and name != "__main__":
        return True
    if name == "__main__" or name not in sys.modules:
        return False
    return file is not None and bool({"site-packages", "dist-packages"} & set(PurePath(file).parts))


# -- functions -----------------------------------------------------------------


def _code(function: FunctionType) -> dict[str, str]:
    """Version of Python, whose byte code can be compared to its own only, and a hash of the code."""
    version = f"{sys.version_info.major}.{sys.version_info.minor}"
    return {PYTHON: version, "hash": _digest(function.__code__)[:16]}


def _digest(code: CodeType) -> str:
    """Hash of byte code and its constants, without names of variables, lines and docstrings."""
    steps = [
        (step.opcode, _constant(step.argval) if step.opcode in dis.hasconst else step.arg)
        for step in dis.get_instructions(code)
    ]
    parts = (steps, code.co_names, code.co_argcount, code.co_flags & ~HAS_DOCSTRING)
    return hashlib.sha256(repr(parts).encode()).hexdigest()


def _constant(value: Any) -> str:
    if isinstance(value, CodeType):
        return _digest(value)
    return repr(sorted(map(repr, value)) if isinstance(value, frozenset) else value)


def _values(function: FunctionType, inside: tuple[int, ...]) -> Iterator[tuple[str, Any]]:
    """Values that a function reads, by the name in its code."""
    names = list(dict.fromkeys(_read(function.__code__)))
    for name, *attributes in names:
        if name not in function.__globals__:
            continue  # of Python, or not set yet
        value = function.__globals__[name]
        while attributes and _is_own(value) and hasattr(value, attributes[0]):
            name, value = f"{name}.{attributes[0]}", getattr(value, attributes.pop(0))
        yield name, meaning(value, inside)
    for name, cell in zip(function.__code__.co_freevars, function.__closure__ or (), strict=True):
        try:
            yield name, meaning(cell.cell_contents, inside)
        except ValueError:  # not set yet
            continue
    given = function.__code__.co_varnames[: function.__code__.co_argcount]
    defaults = function.__defaults__ or ()
    named = dict(zip(given[len(given) - len(defaults) :], defaults, strict=True))
    for name, value in (named | (function.__kwdefaults__ or {})).items():
        yield f"{name}=", meaning(value, inside)


def _is_own(value: Any) -> bool:
    """Whether a value is a module that is not installed."""
    return isinstance(value, ModuleType) and not _installed(value)


def _read(code: CodeType) -> Iterator[tuple[str, ...]]:
    """Global names that code reads and does not set, each with the attributes taken of it."""
    steps = [step for step in dis.get_instructions(code) if step.opname not in ("CACHE", "PRECALL")]
    written = {step.argval for step in steps if step.opname == "STORE_GLOBAL"}
    for k, step in enumerate(steps):
        if step.opname not in ("LOAD_GLOBAL", "LOAD_NAME") or step.argval in written:
            continue
        chain = [step.argval]
        for following in steps[k + 1 :]:
            if following.opname not in ("LOAD_ATTR", "LOAD_METHOD"):
                break
            chain.append(following.argval)
        yield tuple(chain)
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _read(constant)
