"""One thing that was tried: it survives with an error below its bound, or is refused with a sentence.

Anything else is WRONG: an answer worse than its bound, an answer where a refusal was due, an error that
is no sentence. A bound comes from outside the code (a closed form, another method, an invariant); the
comment beside it says from where.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

import tawami

Outcome = Literal["survived", "warned", "refused", "WRONG"]
#: An error, or an error and what there is to say about it.
Measured = float | tuple[float, str]

#: What may be said of an answer beforehand.
WARNINGS = (
    tawami.EnergyWarning,
    tawami.InstabilityWarning,
    tawami.LockingWarning,
    tawami.ParameterWarning,
    tawami.QuadratureWarning,
)

COLUMNS = ("subject", "setting", "outcome", "error", "bound", "says")


@dataclass(frozen=True)
class Attempt:
    """What was tried and what happened.

    Attributes:
        subject: What it belongs to.
        setting: What was tried.
        outcome: 'survived' with its error below its bound; 'warned', an answer worse than that and a
            warning that said so beforehand; 'refused'; 'WRONG'.
        error: Against an independent reference; None where there is no answer.
        bound: Of the error; None where a refusal was due.
        says: The sentence of a refusal or warning, or a remark.
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
    subject: str,
    setting: str,
    bound: float | None,
    run: Callable[[], Measured],
    refusals: tuple[type[Exception], ...] = (tawami.TawamiError,),
) -> Attempt:
    """Try it.

    Args:
        subject: What it belongs to.
        setting: What is tried.
        bound: Of the error; None if it has to be refused.
        run: Gives the error, with a remark if there is one.
        refusals: Errors that are sentences for the user.
    """
    error, says = None, ""
    outcome: Outcome = "WRONG"
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            measured = run()
        except refusals as refusal:
            notes = getattr(refusal, "__notes__", [])
            outcome, says = "refused", " ".join([str(refusal), *notes])
        except Exception as exception:
            says = f"{type(exception).__name__}: {exception}"
        else:
            error, says = measured if isinstance(measured, tuple) else (measured, "")
            said = [str(w.message) for w in caught if issubclass(w.category, WARNINGS)]
            if bound is None:
                says = " ".join(["an answer, where a refusal was due", says]).strip()
            elif math.isfinite(error) and error <= bound:
                outcome = "survived"
            elif said:
                outcome, says = "warned", said[0]
    return Attempt(subject, setting, outcome, error, bound, " ".join(says.split()))


@contextmanager
def untouched(scene: tawami.Scene) -> Iterator[None]:
    """A refusal leaves the particles as they were, to the bit.

    Raises:
        RuntimeError: It did not.
    """
    before = _arrays(scene)
    try:
        yield
    except tawami.TawamiError as refusal:
        for name, values in _arrays(scene).items():
            if not np.array_equal(values, before[name], equal_nan=True):
                raise RuntimeError(f"{name} of the particles changed: {refusal}") from refusal
        raise


def _arrays(scene: tawami.Scene) -> dict[str, Any]:
    particles = scene.particles
    names = ["x", "volume", "stress", "displacement"]
    if scene.form.kinematics.has_eps_v:
        names.append("eps_v")
    arrays = {name: np.array(getattr(particles, name)) for name in names}
    return arrays | {name: np.array(particles.history(name)) for name in particles.history_names}
