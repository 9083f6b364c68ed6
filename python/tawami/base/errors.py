"""Errors and warnings. A message names the input, its value, what is expected, and what to do.

Wrong input from a driver script raises a `TawamiError`; `tawami.run` and `tawami run` print it as one
line. Any other exception is a fault of tawami, or of a function of the driver script that tawami calls.

========================= ========================================================================
TawamiError               base of all errors
  InputError              a wrong argument, value or file
    NotModelledError      an attribute that this scene does not have (also an AttributeError)
  FormError               a weak form that cannot be used
  SupportError            supports that leave a rigid motion free, contradict each other, miss the body
  SingularError           a singular tangent
  SolverError             a linear system that could not be solved for lack of memory, for example
  ConvergenceError        an iteration that did not converge, with its history
  OutputError             a result that cannot be written
  CheckpointError         a checkpoint that cannot be used
  MissingDependencyError  a package that is not installed (also an ImportError)

TawamiWarning             base of warnings about results that should not be trusted (a UserWarning)
  CheckpointWarning       a checkpoint that was not used, or not written
  EnergyWarning           spurious energy
  GeometryWarning         a body whose shape differs from the given one
  InexactSumWarning       a `sum_p` that is not exactly the sum over the particles
  IncompleteWarning       a ramp or a path that ended before its end
  InstabilityWarning      an option that is not stable for this body
  LockingWarning          a form that locks
  ParameterWarning        a parameter beyond its usual range
  QuadratureWarning       particles with large integration errors
  RotationWarning         a nearly incompressible body that turns too far in a step
  SmallStrainWarning      displacement gradients too large for a form of small strain
  SofteningWarning        a material that softens: results depend on the grid
  SupportWarning          a support that holds nothing any more, an obstacle that enters the body
  TangentWarning          a law without a tangent, whose differences take time
========================= ========================================================================

When a step fails, the particles are unchanged.
"""

from __future__ import annotations

from collections.abc import Sequence

from tawami._rust import InputError, TawamiError


class FormError(TawamiError):
    """A weak form that cannot be used."""


class NotModelledError(InputError, AttributeError):
    """An attribute that this scene does not model; the message names the switch that adds it."""


class SupportError(TawamiError):
    """Supports that leave a rigid motion free, contradict each other, or miss the body."""


class TawamiWarning(UserWarning):
    """Base of all warnings about results."""


class EnergyWarning(TawamiWarning):
    """A motion whose energy grew without work by loads or supports."""


class SupportWarning(TawamiWarning):
    """A support that holds nothing any more, or an obstacle that enters the body."""


class GeometryWarning(TawamiWarning):
    """A body whose shape differs from the given one."""


class InexactSumWarning(TawamiWarning):
    """A `sum_p` of an expression whose degree is too high for the exact sum over the particles."""


class IncompleteWarning(TawamiWarning):
    """A ramp or a path that ended before its end; the scene is in its last equilibrium."""


class InstabilityWarning(TawamiWarning):
    """An option of a form that is not stable for this body."""


class LockingWarning(TawamiWarning):
    """A form without a field for the volume, in a case where its mean stress is useless."""


class ParameterWarning(TawamiWarning):
    """A parameter of a form beyond its usual range, where results are inaccurate."""


class QuadratureWarning(TawamiWarning):
    """Particles whose volumes integrate badly over the cells that they fill."""


class RotationWarning(TawamiWarning):
    """A nearly incompressible body that turns too far in a step of a motion."""


class SmallStrainWarning(TawamiWarning):
    """Displacement gradients that are too large for a form of small strain."""


class SofteningWarning(TawamiWarning):
    """A material that softens without a length scale: results depend on the grid."""


class SolverWarning(TawamiWarning):
    """A linear solver that does not converge, so that a more expensive one takes over."""


class TangentWarning(TawamiWarning):
    """A law in NumPy that returns no tangent: its central differences take time."""


class SingularError(TawamiError):
    """A singular tangent; the message names the cells."""


class SolverError(TawamiError):
    """A linear system that could not be solved for a reason other than its values, such as memory."""


class ConvergenceError(TawamiError):
    """A Newton iteration that did not converge.

    Attributes:
        history: (measure of momentum, of volume or None) of every residual; with fields without a role,
            the largest of theirs as well.
    """

    def __init__(self, message: str, history: Sequence[tuple[float | None, ...]]) -> None:
        super().__init__(message)
        self.history = history

    def __reduce__(self) -> tuple[type, tuple[str, Sequence[tuple[float | None, ...]]]]:
        """Keep the history when the error is sent between ranks."""
        return type(self), (str(self), self.history)


class OutputError(TawamiError):
    """A result that cannot be written."""


class CheckpointError(TawamiError):
    """A checkpoint that cannot be used."""


class CheckpointWarning(TawamiWarning):
    """A checkpoint that was not used, or could not be written."""


class MissingDependencyError(TawamiError, ImportError):
    """A package that is not installed; the message says how to install it."""


__all__ = [
    "CheckpointError",
    "CheckpointWarning",
    "ConvergenceError",
    "EnergyWarning",
    "FormError",
    "GeometryWarning",
    "IncompleteWarning",
    "InexactSumWarning",
    "InputError",
    "InstabilityWarning",
    "LockingWarning",
    "MissingDependencyError",
    "NotModelledError",
    "OutputError",
    "ParameterWarning",
    "QuadratureWarning",
    "RotationWarning",
    "SingularError",
    "SmallStrainWarning",
    "SofteningWarning",
    "SolverError",
    "SupportError",
    "SupportWarning",
    "TangentWarning",
    "TawamiError",
    "TawamiWarning",
]
