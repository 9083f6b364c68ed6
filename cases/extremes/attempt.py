"""One thing that was tried: it survives with an error below its bound, or is refused with a sentence.

Anything else is WRONG: an answer worse than its bound, an answer where a refusal was due, an error that
is no sentence. A bound comes from outside the code (a closed form, another method, an invariant); the
comment beside it says from where.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import tawami

#: An error, or an error and what there is to say about it.
Measured = float | tuple[float, str]
Outcome = Literal["survived", "refused", "WRONG"]


@dataclass(frozen=True)
class Attempt:
    """What was tried and what happened.

    Attributes:
        subject: What it belongs to.
        setting: What was tried.
        outcome: 'survived' with its error below its bound, 'refused', or 'WRONG'.
        error: Against an independent reference; None where there is no answer.
        bound: Of the error; None where a refusal was due.
        says: The sentence of a refusal, or a remark.
    """

    subject: str
    setting: str
    outcome: Outcome
    error: float | None
    bound: float | None
    says: str

    @property
    def wrong(self) -> bool:
        """Whether it must not stay so."""
        return self.outcome == "WRONG"


def attempted(
    subject: str, setting: str, bound: float | None, run: Callable[[], Measured]
) -> Attempt:
    """Try it.

    Args:
        subject: What it belongs to.
        setting: What is tried.
        bound: Of the error; None if it has to be refused.
        run: Gives the error, with a remark if there is one.
    """
    error, says = None, ""
    outcome: Outcome = "WRONG"
    try:
        measured = run()
    except tawami.TawamiError as refusal:
        outcome, says = "refused", " ".join([str(refusal), *getattr(refusal, "__notes__", [])])
    except Exception as exception:
        says = f"{type(exception).__name__}: {exception}"
    else:
        error, says = measured if isinstance(measured, tuple) else (measured, "")
        if bound is None:
            says = "an answer, where a refusal was due"
        elif math.isfinite(error) and error <= bound:
            outcome = "survived"
    return Attempt(subject, setting, outcome, error, bound, " ".join(says.split()))
