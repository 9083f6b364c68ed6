"""What can go wrong: every message says which input, what came, what was expected, what to do."""

from __future__ import annotations

from tawami._rust import InputError, TawamiError


class FormError(TawamiError):
    """A weak form that cannot be used as it stands."""


class NotModelledError(InputError, AttributeError):
    """An attribute that this scene does not model; the message names the switch that does."""


class SupportError(TawamiError):
    """Supports that leave a rigid motion free, contradict each other, or miss the body."""


class EnergyWarning(UserWarning):
    """A motion whose energy has grown by what no load and no support gave."""


class GeometryWarning(UserWarning):
    """A body that is not quite of the shape that was given."""


class InstabilityWarning(UserWarning):
    """An option of a form that is not stable for this body."""


class LockingWarning(UserWarning):
    """A form without a field for the volume, where that makes its mean stress useless."""


class ParameterWarning(UserWarning):
    """A parameter of a form beyond its usual range, where answers are far off."""


class QuadratureWarning(UserWarning):
    """Particles that do not integrate over the cells that they fill."""


class SingularError(TawamiError):
    """A tangent that cannot be solved; the message names the cells."""


class ConvergenceError(TawamiError):
    """A Newton iteration that did not converge. `history` holds its measures.

    Attributes:
        history: One (measure of momentum, measure of volume or None) per residual evaluated.
    """

    def __init__(self, message: str, history: list[tuple[float, float | None]]) -> None:
        super().__init__(message)
        self.history = history

    def __reduce__(self) -> tuple[type, tuple[str, list[tuple[float, float | None]]]]:
        """Travels between ranks with its history."""
        return type(self), (str(self), self.history)


class OutputError(TawamiError):
    """A result that cannot be written."""


class MissingDependencyError(TawamiError, ImportError):
    """A package that tawami needs is not there; the message says how to install it."""


__all__ = [
    "ConvergenceError",
    "EnergyWarning",
    "FormError",
    "GeometryWarning",
    "InputError",
    "InstabilityWarning",
    "LockingWarning",
    "MissingDependencyError",
    "NotModelledError",
    "OutputError",
    "ParameterWarning",
    "QuadratureWarning",
    "SingularError",
    "SupportError",
    "TawamiError",
]
