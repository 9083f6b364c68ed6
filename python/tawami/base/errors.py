"""What can go wrong: every message says which input, what came, what was expected, what to do.

A mistake in a driver script raises a `TawamiError`, whatever it passes to tawami; `tawami.run` and
`tawami run` make one line of it. Anything else that comes out of tawami is a fault of tawami, or of
a function of the driver script that tawami called.

========================= ========================================================================
TawamiError               base of all of them
  InputError              an argument, a value or a file that is wrong
    NotModelledError      an attribute that this scene does not have (also an AttributeError)
  FormError               a weak form that cannot be used as it stands
  SupportError            supports that leave a rigid motion free, contradict each other, miss the body
  SingularError           a tangent that cannot be solved
  ConvergenceError        an iteration that did not converge, with its history
  OutputError             a result that cannot be written
  CheckpointError         a checkpoint that cannot be used
  MissingDependencyError  a package that is not there (also an ImportError)

TawamiWarning             base of what is computed and should not be trusted (a UserWarning)
  CheckpointWarning       a checkpoint that was not used, or not written
  EnergyWarning           energy that nothing gave
  GeometryWarning         a body that is not quite of the shape that was given
  InexactSumWarning       a `sum_p` that is not exactly the sum over the particles
  InstabilityWarning      an option that is not stable for this body
  LockingWarning          a form that locks
  ParameterWarning        a parameter beyond its usual range
  QuadratureWarning       particles that integrate badly
========================= ========================================================================

After an error of a step nothing is lost: the particles are as they were before it.
"""

from __future__ import annotations

from tawami._rust import InputError, TawamiError


class FormError(TawamiError):
    """A weak form that cannot be used as it stands."""


class NotModelledError(InputError, AttributeError):
    """An attribute that this scene does not model; the message names the switch that does."""


class SupportError(TawamiError):
    """Supports that leave a rigid motion free, contradict each other, or miss the body."""


class TawamiWarning(UserWarning):
    """Base of every warning about what is computed."""


class EnergyWarning(TawamiWarning):
    """A motion whose energy has grown by what no load and no support gave."""


class GeometryWarning(TawamiWarning):
    """A body that is not quite of the shape that was given."""


class InexactSumWarning(TawamiWarning):
    """A `sum_p` of an expression of too high a degree to be the sum over the particles."""


class InstabilityWarning(TawamiWarning):
    """An option of a form that is not stable for this body."""


class LockingWarning(TawamiWarning):
    """A form without a field for the volume, where that makes its mean stress useless."""


class ParameterWarning(TawamiWarning):
    """A parameter of a form beyond its usual range, where answers are far off."""


class QuadratureWarning(TawamiWarning):
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


class CheckpointError(TawamiError):
    """A checkpoint that cannot be used."""


class CheckpointWarning(TawamiWarning):
    """A checkpoint that was not used, or could not be written."""


class MissingDependencyError(TawamiError, ImportError):
    """A package that tawami needs is not there; the message says how to install it."""


__all__ = [
    "CheckpointError",
    "CheckpointWarning",
    "ConvergenceError",
    "EnergyWarning",
    "FormError",
    "GeometryWarning",
    "InexactSumWarning",
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
    "TawamiWarning",
]
