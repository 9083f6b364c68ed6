"""One attempt at an extreme: what was tried and what happened. It survives with an error below a bound
that was stated beforehand, or it is refused with a sentence; all else is wrong.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import tawami


@dataclass(frozen=True)
class Attempt:
    """What was tried and what happened.

    Attributes:
        subject: What is taken to its extreme.
        setting: How far.
        outcome: 'WRONG' is a result beyond its bound, or an error without a sentence.
        error: Distance from a reference outside the method; None without a result.
        bound: The largest error that is right.
        says: The sentence of a refusal, or what is wrong.
    """

    subject: str
    setting: str
    outcome: Literal["survived", "refused", "WRONG"]
    error: float | None
    bound: float | None
    says: str = ""


def attempted(subject: str, setting: str, bound: float, run: Callable[[], float]) -> Attempt:
    """Try something.

    Args:
        subject: What is taken to its extreme.
        setting: How far.
        bound: The largest error that is right.
        run: Gives the error, or is refused.
    """
    try:
        error = float(run())
    except tawami.TawamiError as refusal:
        says = " ".join([str(refusal), *getattr(refusal, "__notes__", [])])
        return Attempt(subject, setting, "refused", None, bound, says)
    except Exception as exception:
        says = f"{type(exception).__name__}: {exception}"
        return Attempt(subject, setting, "WRONG", None, bound, says)
    if error <= bound:  # false for NaN
        return Attempt(subject, setting, "survived", error, bound)
    return Attempt(subject, setting, "WRONG", error, bound, f"{error:.3g} instead of {bound:.3g}")
