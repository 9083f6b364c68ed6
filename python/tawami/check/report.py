"""The table of `tawami form check`."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import groupby
from typing import Any, Literal

from tawami.base.checks import shown
from tawami.base.errors import InputError
from tawami.form.form import Form

Verdict = Literal["pass", "cost", "broken", "not tried"]
Found = Iterator[tuple[Verdict, str]]
Check = Callable[[Form, dict[str, Any]], Found]
#: Bounds of relative errors: of finite differences, of round-off, of uniform stresses by Newton.
DIFFERENCES, ROUND_OFF, UNIFORM = 1e-6, 1e-11, 1e-8


@dataclass(frozen=True)
class Line:
    """One check: its subject, its verdict, and the numbers or the reason."""

    subject: str
    verdict: Verdict
    words: str

    def __str__(self) -> str:
        return f"{self.verdict:9} {self.subject:24} {self.words}"


@dataclass(frozen=True)
class FormReport:
    """The results of :func:`check_form`; `print` shows them as a table.

    Attributes:
        name: Name of the form.
        lines: The checks in order.
    """

    name: str
    lines: tuple[Line, ...]

    @property
    def broken(self) -> tuple[Line, ...]:
        """The checks that show that the form cannot be used."""
        return tuple(line for line in self.lines if line.verdict == "broken")

    @property
    def usable(self) -> bool:
        """Whether nothing is broken; it may have costs."""
        return not self.broken

    def line(self, subject: str) -> Line:
        """The first check of a subject.

        Raises:
            InputError: No such subject.
        """
        for line in self.lines:
            if line.subject == subject:
                return line
        known = ", ".join(repr(line.subject) for line in self.lines)
        raise InputError(f"line({shown(subject)}): expected one of {known}")

    def __str__(self) -> str:
        costs = sum(line.verdict == "cost" for line in self.lines)
        end = "it can be used" if self.usable else f"it cannot be used: {len(self.broken)} broken"
        end += f", {costs} cost{'s' if costs > 1 else ''}" if costs else ""
        return "\n".join([f"form {self.name}", *map(str, _joined(self.lines)), end])


def _joined(lines: tuple[Line, ...]) -> Iterator[Line]:
    """Lines with consecutive ones that were not tried for the same reason in one."""
    for (verdict, words), group in groupby(
        lines, lambda line: (line.verdict, line.words if line.verdict == "not tried" else line)
    ):
        same = list(group)
        if verdict != "not tried" or len(same) == 1:
            yield from same
            continue
        subjects = dict.fromkeys(line.subject for line in same)
        yield Line(f"{len(subjects)} checks", "not tried", f"{words}: {', '.join(subjects)}")


def judged(error: float, bound: float, what: str, otherwise: str = "") -> tuple[Verdict, str]:
    """Verdict on a relative error with a bound, and what to do where it is too large."""
    if error < bound:  # NaN is not
        return "pass", f"{what}: {error:.1e} (< {bound:g})"
    return "broken", f"{what}: {error:.1e} (expected < {bound:g}){otherwise}"
