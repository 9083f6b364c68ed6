"""One attempt at a limit: it survives with an error below its bound, or an error message rejects it.

Everything else is WRONG: an error above the bound, a result where an error message was due, or an
exception that is not an error message of tawami. A bound comes from outside the code: a closed form,
another method, or an invariant. The comment next to it names the source.
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
#: An error, or an error and a remark.
Measured = float | tuple[float, str]

#: Warnings that may precede a result above its bound.
WARNINGS = (
    tawami.EnergyWarning,
    tawami.InstabilityWarning,
    tawami.LockingWarning,
    tawami.ParameterWarning,
    tawami.QuadratureWarning,
    tawami.SupportWarning,
)

COLUMNS = ("subject", "setting", "outcome", "error", "bound", "says")


@dataclass(frozen=True)
class Attempt:
    """An attempt and its outcome.

    Attributes:
        subject: The subject it belongs to.
        setting: The setting that was tried.
        outcome: 'survived' with an error below the bound; 'warned' with a larger error and a warning
            before it; 'refused' with an error message; 'WRONG'.
        error: Error against an independent reference; None without a result.
        bound: Bound of the error; None if an error message is due.
        says: Error message, warning or remark.
    """

    subject: str
    setting: str
    outcome: Outcome
    error: float | None
    bound: float | None
    says: str

    @property
    def wrong(self) -> bool:
        """Whether the outcome is a fault of the code."""
        return self.outcome == "WRONG"


def attempted(
    subject: str,
    setting: str,
    bound: float | None,
    run: Callable[[], Measured],
    refusals: tuple[type[Exception], ...] = (tawami.TawamiError,),
) -> Attempt:
    """Run an attempt.

    Args:
        subject: The subject it belongs to.
        setting: The setting that is tried.
        bound: Bound of the error; None if an error message is due.
        run: Returns the error, or the error and a remark.
        refusals: Exceptions that count as error messages.
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
                says = " ".join(["a result, where an error message was due", says]).strip()
            elif math.isfinite(error) and error <= bound:
                outcome = "survived"
            elif said:
                outcome, says = "warned", said[0]
    return Attempt(subject, setting, outcome, error, bound, " ".join(says.split()))


@contextmanager
def untouched(scene: tawami.Scene) -> Iterator[None]:
    """Check that an error in the block leaves the particles unchanged, bit for bit.

    Raises:
        RuntimeError: The particles have changed.
    """
    before = _arrays(scene)
    try:
        yield
    except tawami.TawamiError as refusal:
        for name, values in _arrays(scene).items():
            if not np.array_equal(values, before[name], equal_nan=True):
                raise RuntimeError(f"{name} of the particles changed: {refusal}") from refusal
        raise


def array_names(scene: tawami.Scene) -> list[str]:
    """Names of the arrays that the particles of a scene have without a history."""
    names = ["x", "volume", "stress", "displacement"]
    return [*names, "eps_v"] if "eps_v" in scene.form.fields else names


def _arrays(scene: tawami.Scene) -> dict[str, Any]:
    particles = scene.particles
    arrays = {name: np.array(getattr(particles, name)) for name in array_names(scene)}
    return arrays | {name: np.array(particles.history(name)) for name in particles.history_names}
