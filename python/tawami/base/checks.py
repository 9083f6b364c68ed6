"""Checks of input: each returns the value in its proper type, or raises an InputError."""

from __future__ import annotations

import math
import os
import resource
import sys
from collections.abc import Callable, Collection, Sequence
from numbers import Integral, Real
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from tawami.base.arrays import Array
from tawami.base.errors import InputError
from tawami.base.text import meant

#: The smallest number above 0.
LEAST = sys.float_info.min
#: Characters of a value that a message shows.
SHOWN = 200
#: Sequences of Python that are no sequences of numbers.
TEXT = (str, bytes, bytearray, memoryview)


def shown(value: Any) -> str:
    """A value as text for a message, cut off if it is long; its type if it has no text."""
    try:
        text = repr(value)
    except Exception:  # integers of thousands of digits, objects of other packages
        return f"<{type(value).__name__}>"
    return text if len(text) <= SHOWN else f"{text[:SHOWN]}..."


def real(name: str, value: Any, expected: str = "a number") -> float:
    """A real number, which may be infinite or NaN.

    Raises:
        InputError: Anything else.
    """
    if not isinstance(value, Real) or isinstance(value, np.timedelta64):
        raise InputError(f"{name} = {shown(value)}: expected {expected}")
    try:
        return float(value)
    except OverflowError:
        return math.inf if value > 0 else -math.inf  # type: ignore[operator]


def number(name: str, value: Any, *, low: float = -math.inf, high: float = math.inf) -> float:
    """A finite number within limits.

    Raises:
        InputError: Anything else.
    """
    given = real(name, value)
    if not (math.isfinite(given) and low <= given <= high):
        least = "above 0" if low == LEAST else f"of at least {low:g}"
        within = f" {least}" if math.isinf(high) else f" {least} and at most {high:g}"
        if math.isinf(low):
            within = "" if math.isinf(high) else f" of at most {high:g}"
        raise InputError(f"{name} = {shown(value)}: expected a finite number{within}")
    return given


def whole_number(name: str, value: Any, *, low: int, high: float = math.inf) -> int:
    """A whole number, at least `low`.

    Raises:
        InputError: Anything else.
    """
    whole = isinstance(value, Integral) and not isinstance(value, np.timedelta64)
    if not whole or not low <= int(value) <= high:
        most = "" if math.isinf(high) else f" and at most {high:g}"
        raise InputError(f"{name} = {shown(value)}: expected a whole number, at least {low}{most}")
    return int(value)


def pair(name: str, value: Any, what: str) -> tuple[Any, Any]:
    """A sequence of two.

    Raises:
        InputError: Anything else; `what` says what the two are.
    """
    sequence = isinstance(value, Sequence) or (isinstance(value, np.ndarray) and value.ndim > 0)
    if isinstance(value, TEXT) or not sequence or len(value) != 2:
        raise InputError(f"{name} = {shown(value)}: expected two {what}")
    return value[0], value[1]


def choice(name: str, value: Any, known: Collection[str], wrong: str = "") -> Any:
    """One of the known names.

    Raises:
        InputError: Anything else; `wrong` says why, if that is not obvious.
    """
    if not one_of(value, known):
        *others, last = map(repr, known)
        listed = (
            f"one of {', '.join([*others, last])}" if len(others) != 1 else f"{others[0]} or {last}"
        )
        hint = meant(value, known) if isinstance(value, str) else ""
        raise InputError(f"{name} = {shown(value)}: {wrong}expected {listed}{hint}")
    return value


def names(name: str, value: Any, known: Collection[str]) -> tuple[str, ...]:
    """Some of the known names.

    Raises:
        InputError: Anything else.
    """
    some = isinstance(value, list | tuple | set | frozenset)
    if not some or not all(one_of(given, known) for given in value):
        listed = ", ".join(map(repr, known))
        raise InputError(f"{name} = {shown(value)}: expected a list with some of {listed}")
    return tuple(value)


def point(name: str, value: Any) -> tuple[float, float]:
    """A point (x, y) [m].

    Raises:
        InputError: Anything but two finite numbers.
    """
    x, y = pair(name, value, "numbers, a point (x, y)")
    return number(f"{name}[0]", x), number(f"{name}[1]", y)


def one_of(value: Any, names: Collection[Any]) -> bool:
    """Whether a value is one of some names."""
    return isinstance(value, str) and value in names


def switch(name: str, value: Any) -> bool:
    """True or False.

    Raises:
        InputError: Anything else.
    """
    if not isinstance(value, bool | np.bool_):
        raise InputError(f"{name} = {shown(value)}: expected True or False")
    return bool(value)


def function(name: str, value: Any, what: str) -> Any:
    """A function, or None.

    Raises:
        InputError: Anything else; `what` says what its arguments are.
    """
    if value is not None and not callable(value):
        raise InputError(f"{name} = {shown(value)}: expected a function {what}")
    return value


def profile(name: str, value: Any) -> float | Callable[..., Any]:
    """A number, or a function of position; its values are checked when it is called.

    Raises:
        InputError: Anything else.
    """
    if callable(value):
        return value  # type: ignore[no-any-return]
    if not isinstance(value, Real):
        raise InputError(f"{name} = {shown(value)}: expected a number or a function f(x, y)")
    return number(name, value)


def instance(name: str, value: Any, kind: Any, expected: str) -> None:
    """Check that an object is of a class.

    Raises:
        InputError: It is not.
    """
    if not isinstance(value, kind):
        raise InputError(f"{name} = {shown(value)}: expected {expected}")


def path(name: str, value: Any) -> Path:
    """A path, as text or Path; whether it exists is checked by `tawami.base.files`.

    Raises:
        InputError: Anything else, or characters that no path has.
    """
    try:
        if isinstance(value, TEXT[1:]):
            raise TypeError
        os.fsencode(value)
        if "\0" in os.fspath(value):
            raise ValueError
    except TypeError:
        raise InputError(f"{name} = {shown(value)}: expected a path, as text or Path") from None
    except ValueError:
        raise InputError(
            f"{name} = {shown(value)}: expected a path without NUL and characters that the file system "
            "cannot encode"
        ) from None
    return Path(value)


def array(name: str, values: Any, dimensions: int) -> Array:
    """A contiguous array of real numbers.

    Raises:
        InputError: Not numbers, not real, masked, or another number of dimensions.
    """
    raw = any_array(name, values)
    if raw.dtype.kind not in "fiu":
        raise InputError(f"{name}: expected an array of real numbers: it holds {raw.dtype}")
    if raw.ndim != dimensions:
        raise InputError(f"{name} has shape {raw.shape}: expected {dimensions} dimensions")
    with np.errstate(over="ignore"):  # longer floating-point numbers become infinite
        return np.ascontiguousarray(raw, dtype=np.float64)


def real_values(values: Any) -> Array:
    """An array of real numbers, from what a function of the driver script returned.

    Raises:
        TypeError: Complex numbers, whose imaginary parts NumPy would drop, text, or no numbers.
        ValueError: No array.
    """
    raw = np.asarray(values)
    if raw.dtype.kind == "c":
        raise TypeError("complex numbers")
    if raw.dtype.kind in "US":
        raise TypeError("text")
    return raw.astype(float)


def any_array(name: str, values: Any) -> npt.NDArray[Any]:
    """Any array of NumPy.

    Raises:
        InputError: NumPy makes no array of it, or entries are masked.
    """
    try:
        masked = np.ma.is_masked(values)  # type: ignore[no-untyped-call]
        made = np.asarray(values)
    except Exception as error:  # ragged lists, objects of other packages
        raise InputError(f"{name}: expected an array of real numbers: {error}") from None
    if masked:
        raise InputError(f"{name} has masked entries: expected an array without a mask")
    return made


def numbering(name: str, values: Any, length: int) -> npt.NDArray[np.uint32]:
    """Whole numbers from 0, one per particle.

    Raises:
        InputError: Another length, a fraction, or a negative number.
    """
    raw = array(name, values, 1)
    if len(raw) != length:
        raise InputError(f"{name} has {len(raw)} entries: expected {length}, one per particle")
    wrong = np.flatnonzero(~((raw >= 0) & (raw == np.floor(raw)) & (raw < 2**32)))
    if len(wrong):
        raise InputError(
            f"{name}[{wrong[0]}] = {raw[wrong[0]]:g}: expected the number of a material, from 0"
        )
    return raw.astype(np.uint32)


def room(what: str, count: int, each: float, advice: str) -> None:
    """Check that the memory of this machine is enough, before it is allocated.

    Args:
        what: Input that decides the number of objects.
        count: Number of objects.
        each: Memory of one object [bytes].
        advice: Advice for the message.

    Raises:
        InputError: It is not enough; the message says how much is needed.
    """
    available = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    available = available if limit == resource.RLIM_INFINITY else min(available, limit)
    size = float(min(count, 10**300)) * each
    if size > available:
        raise InputError(
            f"{what} needs about {size / 2**30:.3g} GB of memory, and {available / 2**30:.3g} GB are "
            f"available: {advice}"
        )
