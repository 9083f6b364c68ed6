"""Material laws in NumPy, to try a law before it is written in Rust."""

from __future__ import annotations

import inspect
import keyword
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from tawami import _rust
from tawami.base import checks
from tawami.base.arrays import Array
from tawami.base.errors import InputError
from tawami.base.identity import text

#: Most history variables of a law, as in `rust/law/mod.rs`.
MOST_VARIABLES = 8
#: Names of other arrays and quantities of particles.
TAKEN = {
    "x", "volume", "material", "number", "stress", "strain", "displacement", "displacement_gradient",
    "eps_v", "velocity", "acceleration", "velocity_gradient", "acceleration_gradient", "mean_stress",
    "deviatoric_stress_q",
}  # fmt: skip
#: Step of a difference relative to the strain, and least size of a strain. The step balances the error
#: of a central difference, step^2, and the round-off, epsilon / step.
STEP, LEAST = 6e-6, 1e-4

WithoutHistory = Callable[[Array, Array], Any]
WithHistory = Callable[[Array, Array, dict[str, Array]], Any]


@dataclass(frozen=True)
class NumpyLaw:
    """A material law as a function of a driver script, for any of the particles of a scene.

    `respond(strain, stress)` or, with history variables, `respond(strain, stress, history)` is called
    with all n particles that have the law, on several ranks with those of the rank. It returns the state
    at the end of the step:

    ===================  ==============================  =========================================
    of the law           it returns                      or, without a tangent
    ===================  ==============================  =========================================
    without history      `stress, tangent`               `stress`
    with history         `stress, tangent, history`      `stress, history`
    ===================  ==============================  =========================================

    Components are xx, yy, zz, xy, tension positive. A strain contains gamma_xy = 2 eps_xy.

    - `strain` (n x 4): increment of the strain in the step. At finite strain: the elastic trial strain,
      logarithmic (Hencky), counted from the stress-free state.
    - `stress` (n x 4) [Pa]: at the start of the step, and the returned one at its end. At finite strain:
      the Kirchhoff stress, and 0 at the start, because the strain is the total elastic one.
    - `history`: dictionary from each name to its values (n), at the start and at the end of the step.
    - `tangent` (n x 4 x 4) [Pa]: consistent, tangent[:, i, j] = d stress_i / d strain_j.

    A small-strain law that adds C : strain to the stress, with the isotropic C of K and mu, and returns
    the sum to a yield surface, is thereby a finite-strain law (Simo and Hughes 1998, chapter 9). If its
    elasticity is not that of K and mu, use it at small strain only.

    Without a tangent, its derivatives are central differences: each evaluation calls `respond` 9 times
    instead of once, and the scene warns of it (`TangentWarning`). A form with a field for the mean
    stress finds the volume at which the law has that mean stress: this takes 1 call in each iteration,
    and 3 without a tangent. The response of a particle must not depend on the other particles.

    Args:
        respond: The function.
        K: Bulk modulus in forms, in the scaling and in the elastic energy [Pa]; finite.
        mu: Shear modulus there [Pa].
        history: Names of the history variables, at most 8, or a dictionary with their units, as
            {"p_c": "Pa"}. They are 0 at first; `scene.initial` sets other values, and
            `scene.particles.history(name)` reads them.

    Raises:
        InputError: K or mu is not a positive, finite number, a name is not possible, or respond takes
            other arguments.
    """

    respond: WithoutHistory | WithHistory
    K: float
    mu: float
    history: Sequence[str] | Mapping[str, str] = ()

    def __post_init__(self) -> None:
        if not callable(self.respond):
            raise InputError(
                f"NumpyLaw: respond = {checks.shown(self.respond)}: expected a function of strain and "
                "stress, and of the history if there is one"
            )
        object.__setattr__(self, "history", _names(self.name, self.history))
        _check_arguments(self)
        _ = self.material

    @property
    def name(self) -> str:
        """Name of the law in messages, with that of its function."""
        function = getattr(self.respond, "__name__", type(self.respond).__name__)
        return f"NumpyLaw({str(function).strip('<>')})"

    @property
    def units(self) -> dict[str, str]:
        """Units of the history variables."""
        given = self.history
        return dict(given) if isinstance(given, Mapping) else dict.fromkeys(given, "-")

    def identity(self) -> Any:
        """Facts that identify the law, besides its material, for checkpoints."""
        return text(self.respond)

    @cached_property
    def material(self) -> _rust.Material:
        """Name, moduli and history variables, as the Rust part knows the law."""
        try:
            K, mu = checks.real("K", self.K), checks.real("mu", self.mu)
            return _rust.Material.external(self.name, (K, mu), list(self.history))
        except InputError as error:
            raise InputError(f"{self.name}: {error}") from None


@dataclass(frozen=True)
class Response:
    """State of particles at the end of a step.

    Attributes:
        stress: n x 4 [Pa].
        tangent: n x 4 x 4 [Pa]; None if the law did not return it.
        history: n x variables.
    """

    stress: Array
    tangent: Array | None
    history: Array


@dataclass(frozen=True)
class Start:
    """State of the particles of a law at the start of a step.

    Args:
        law: The law.
        stress: n x 4 [Pa].
        history: n x variables.
        number: Numbers of the particles, for messages.
    """

    law: NumpyLaw
    stress: Array
    history: Array
    number: npt.NDArray[Any]

    def respond(self, strain: Array) -> Response:
        """Response of the law to strains, n x 4.

        Raises:
            InputError: It returned something else, or numbers that are not finite.
        """
        law, n = self.law, len(strain)
        arguments: list[Any] = [strain.copy(), self.stress.copy()]
        if law.history:
            arguments.append(
                {name: self.history[:, k].copy() for k, name in enumerate(law.history)}
            )
        stress, tangent, history = self._parts(law.respond(*arguments))
        new = np.empty((n, len(law.history)))
        for k, name in enumerate(law.history):
            new[:, k] = self._checked(name, history[name], (n,), strain)
        return Response(
            self._checked("stress", stress, (n, 4), strain),
            None if tangent is None else self._checked("tangent", tangent, (n, 4, 4), strain),
            new,
        )

    def _parts(self, result: Any) -> tuple[Any, Any, dict[str, Any]]:
        """Stress, tangent or None, and history, as they were returned."""
        law = self.law
        parts = list(result) if isinstance(result, tuple) else [result]
        history: Any = {}
        if law.history:
            *parts, history = parts
            listed = ", ".join(map(repr, law.history))
            if not isinstance(history, dict) or set(history) != set(law.history):
                came = _described(history)
                raise InputError(
                    f"{law.name}: respond returned {came} as history of {self._who}: expected a "
                    f"dictionary with {listed} behind stress and tangent"
                )
        if len(parts) not in (1, 2):
            more = ", history" if law.history else ""
            raise InputError(
                f"{law.name}: respond returned {_described(result)} for {self._who}: expected (stress, "
                f"tangent{more}), or {'(stress, history)' if more else 'the stress'} without a tangent"
            )
        return parts[0], parts[1] if len(parts) == 2 else None, history

    def _checked(self, name: str, values: Any, shape: tuple[int, ...], strain: Array) -> Array:
        what = f"{self.law.name}: {name} that respond returned"
        raw = checks.any_array(what, values)
        array = checks.array(what, raw, raw.ndim)
        if array.shape != shape:
            raise InputError(
                f"{self.law.name}: respond returned {name} of shape {array.shape} for {self._who}: "
                f"expected {shape}"
            )
        bad = np.flatnonzero(~np.isfinite(array.reshape(len(array), -1)).all(axis=1))
        if len(bad):
            p = bad[0]
            row = array[p].ravel()
            raise InputError(
                f"{self.law.name}: respond returned {name} that is not finite at {len(bad)} particles, "
                f"the first is {self.number[p]}: {row[~np.isfinite(row)][0]} at the strain {strain[p]} "
                f"and the old stress {self.stress[p]} Pa; expected finite numbers"
            )
        return array

    @property
    def _who(self) -> str:
        n = len(self.number)
        return f"particle {self.number[0]}" if n == 1 else f"{n} particles from {self.number[0]} on"

    def differences(self, strain: Array) -> tuple[Array, Array]:
        """Central differences of stress (n x 4 x 4) [Pa] and history (n x variables x 4) with strain."""
        tangent = np.empty((*strain.shape, strain.shape[1]))
        slopes = np.empty((*self.history.shape, strain.shape[1]))
        for j, unit in enumerate(np.eye(strain.shape[1])):
            tangent[:, :, j], slopes[:, :, j] = self.slope(strain, unit)
        return tangent, slopes

    def slope(self, strain: Array, direction: Array) -> tuple[Array, Array]:
        """Derivative of stress [Pa] and history along a direction of strain: n x 4, n x variables."""
        elastic = np.abs(self.stress).max(axis=1) / self.law.mu
        step = STEP * np.maximum(np.maximum(np.abs(strain).max(axis=1), elastic), LEAST)[:, None]
        more, less = (self.respond(strain + sign * step * direction) for sign in (1.0, -1.0))
        return (more.stress - less.stress) / (2 * step), (more.history - less.history) / (2 * step)


def _check_arguments(law: NumpyLaw) -> None:
    """Check that the function of a law takes as many arguments as it gets."""
    expected = ["strain", "stress", *(["history"] if law.history else [])]
    try:
        inspect.signature(law.respond).bind(*expected)
    except TypeError:
        advice = "" if law.history else "; with history variables NumpyLaw(..., history=(...))"
        takes = ", ".join(inspect.signature(law.respond).parameters)
        raise InputError(
            f"{law.name}: respond takes ({takes}): expected a function of "
            f"{', '.join(expected)}{advice}"
        ) from None
    except ValueError:  # a function of another language, without a signature
        pass


def _described(value: Any) -> str:
    """A value that was returned, for a message."""
    if isinstance(value, dict):
        return f"a dictionary with {', '.join(map(repr, value)) or 'nothing'}"
    if isinstance(value, tuple):
        return f"{len(value)} values"
    shape = getattr(value, "shape", None)
    return checks.shown(value) if shape is None else f"an array of shape {shape}"


def _names(law: str, given: Any) -> Any:
    """Names of history variables, or a dictionary with their units.

    Raises:
        InputError: They cannot be that.
    """
    several = isinstance(given, list | tuple | dict) and len(given) <= MOST_VARIABLES
    if not several or len(set(map(repr, given))) < len(given):
        raise InputError(
            f"{law}: history = {checks.shown(given)}: expected at most {MOST_VARIABLES} different "
            "names, as history=('plastic_strain',), or a dictionary with units, as {'p_c': 'Pa'}"
        )
    for name in given:
        usable = isinstance(name, str) and name.isidentifier() and not keyword.iskeyword(name)
        if not usable or name in TAKEN:
            why = " that particles do not have already" if usable else ""
            raise InputError(
                f"{law}: history variable {checks.shown(name)}: expected a name of letters, digits and _"
                f"{why}, as 'plastic_strain'"
            )
    if not isinstance(given, dict):
        return tuple(given)
    for name, unit in given.items():
        if not isinstance(unit, str) or not unit or "]" in unit:
            raise InputError(
                f"{law}: unit of {name} = {checks.shown(unit)}: expected text, as 'Pa', or '-' for none"
            )
    return dict(given)
