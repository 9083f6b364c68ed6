"""The lines of a form, for messages: where a term was written, and where an error was raised."""

from __future__ import annotations

import inspect
import linecache
import logging
import sys
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, NoReturn

import ufl

from tawami.base.errors import FormError, TawamiError

# errors of UFL become messages of tawami, and need not be printed besides
logging.getLogger("UFL").setLevel(logging.CRITICAL)
#: Longest piece of source in a message.
LONGEST = 60


class Lines:
    """The source of a residual.

    Args:
        name: Name of the form in messages.
        residual: Its residual.

    Attributes:
        first: Its first line; None for a function that is not written in Python.
    """

    def __init__(self, name: str, residual: Callable[..., Any]) -> None:
        self._name = name
        code = getattr(inspect.unwrap(residual), "__code__", None)
        self._file = None if code is None else code.co_filename
        self.first = None if code is None else code.co_firstlineno

    def here(self) -> int | None:
        """The line of the residual's file that is being run; None outside it."""
        frame = sys._getframe(1)
        while frame is not None and frame.f_code.co_filename != self._file:
            if frame.f_back is None:
                return None
            frame = frame.f_back
        return frame.f_lineno

    def of(self, error: BaseException) -> int | None:
        """The last line of the residual's file that an error passed through."""
        frames = traceback.extract_tb(error.__traceback__)
        lines = [frame.lineno for frame in frames if frame.filename == self._file]
        return lines[-1] if lines else None

    def text(self, line: int | None) -> str:
        """Form and line as a message begins: `form 'my_form', line 12 (R += ...)`."""
        if line is None or self._file is None:
            return f"form {self._name}"
        source = linecache.getline(self._file, line).strip()
        if len(source) > LONGEST:
            source = source[: LONGEST - 4] + " ..."
        return f"form {self._name}, line {line}" + (f" ({source})" if source else "")

    @contextmanager
    def errors(self, form: Any) -> Iterator[None]:
        """Raise the errors of UFL and FFCx as errors of tawami that name form and line.

        Args:
            form: The terms that are compiled.
        """
        lines = {line_of(part) for part in form.integrals()}
        where = self.text(lines.pop() if len(lines) == 1 else None)
        try:
            yield
        except TawamiError as error:  # of a name of the residual, or of the cache of compiled forms
            if str(error).startswith("form "):
                raise
            raise type(error)(f"{where}: {error}") from error
        except Exception as error:
            cause = " ".join(str(error).split())
            raise FormError(f"{where}: UFL or FFCx rejected it: {cause}") from error


class Measure(ufl.Measure):  # type: ignore[misc]
    """A measure of a residual, whose integrals remember the line where they were written."""

    def __init__(
        self, lines: Lines, kind: str, domain: Any, metadata: dict[str, Any], factor: Any = 1
    ) -> None:
        super().__init__(kind, domain=domain, metadata=metadata)
        self._lines, self._factor = lines, factor

    def __call__(self, *given: Any, **_: Any) -> NoReturn:
        """Raise an error: the particles determine the domain."""
        what = ", ".join(map(str, given)) or "..."
        raise FormError(
            f"a measure with a number, as dx({what}): expected dx and dx_c without a number; the "
            "particles determine the domain"
        )

    def __rmul__(self, integrand: Any) -> Any:
        metadata = {**self.metadata(), "line": self._lines.here()}
        measure = ufl.Measure(self.integral_type(), self.ufl_domain(), metadata=metadata)
        return measure.__rmul__(self._factor * ufl.as_ufl(integrand))


def line_of(integral: Any) -> int | None:
    """The line where an integral was written."""
    line: int | None = integral.metadata().get("line")
    return line


def without_line(integral: Any) -> Any:
    """An integral as FFCx compiles it."""
    metadata = {k: v for k, v in integral.metadata().items() if k not in ("line", "place", "on")}
    return integral.reconstruct(metadata=metadata)
