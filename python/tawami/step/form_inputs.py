"""Inputs of a form besides the state of the particles: data, parameters, time, dt and gravity."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from tawami.base import checks, ranks
from tawami.base.arrays import Array
from tawami.base.errors import CheckpointError, InputError
from tawami.base.sealed import Settings
from tawami.base.text import meant, quoted
from tawami.conditions.factor import Factor
from tawami.conditions.share import Moment
from tawami.domain import sources
from tawami.domain.border_sums import BorderSums
from tawami.domain.domain import Domain
from tawami.domain.model import Model
from tawami.domain.parameters import by_kind, misplaced


class FormInputs:
    """Inputs of the form of a scene, which may change between its steps.

    Args:
        model: Grid, form and laws.
        time: Time of the scene [s].
        border: Numbers of the points of the border.
    """

    def __init__(self, model: Model, time: float, border: BorderSums) -> None:
        self._form, self._is_checked = model.form, False
        self._border = border
        #: Time of the last step [s], its length [s], and its part of a phase, 0 at the end of one.
        self._latest, self._dt, self._part = time, 0.0, 0.0
        self._values: dict[str, Any] = dict(model.values)
        self._numbers = frozenset(model.parameters)
        self._in_time = {
            name: Factor(f"parameter '{name}'", given, name="", time=time)
            for name, given in model.in_time.items()
        }

    @property
    def parameters(self) -> Settings[float]:
        """Present values of the parameters that are numbers."""
        known = {n: v for n, v in self._values.items() if n in self._numbers}
        return Settings(known, "expected scene.parameter(name, value), between two steps")

    def begin(self, model: Model, domain: Domain) -> None:
        """Give the particles of a new scene the parameters with one number each."""
        for name, source in model.in_space.items():
            domain.particles.carry(name, 1)
            self._to_particles(domain, name, source)
        if "dt" not in model.compiled.used and not self._form.data:
            self._hand(domain, 0.0, 0.0, np.zeros(model.space.dim))

    def _check_incompressible(self, domain: Domain) -> None:
        """Check that a form of an incompressible material contains its K in no other way than 1 / K.

        Raises:
            InputError: It has a term that is infinite.
        """
        bulk = domain.responses.constants["K"]
        infinite = ranks.anywhere(domain.model.grid.comm, np.isinf(bulk).any())
        if infinite and not np.isfinite(domain.newton.internal(np.zeros(domain.layout.size))).all():
            mine = domain.particles.number[np.isinf(bulk)]
            which = f"particle {mine[0]}" if len(mine) else "a particle of another rank"
            raise InputError(
                f"form {self._form.name}: 'K' is not finite at {which}, where nu = 0.5: expected 1 / K "
                "in its terms, as in form 'u_p', or nu < 0.5"
            )

    def set_data(self, domain: Domain, name: str, source: Any) -> None:
        """Give the particles the data of the form with this name; see `Scene.data`."""
        declared = self._form.data
        if not checks.one_of(name, declared):
            known, what = quoted(declared) or "none", f"data({checks.shown(name)}, ...)"
            if wrong := misplaced(self._form, name, what):
                raise wrong
            raise InputError(
                f"{what}: form {self._form.name} declares no such data: "
                f"expected one of {known}{meant(str(name), declared)}"
            )
        unit = self._form.data_unit(name)
        found = sources.values(domain, name, source, "value", unit, f"data '{name}'")
        with ranks.raise_together(domain.model.grid.comm):
            self._border.set(name, source, f"data '{name}'")
        domain.particles.carry(name, 1)
        domain.particles.carried(name)[:, 0] = found[:, 0]

    def set_parameter(self, domain: Domain, name: str, given: Any) -> None:
        """Change a parameter; see `Scene.parameter`."""
        model, form = domain.model, self._form
        if not checks.one_of(name, form.parameters):
            what = f"parameter({checks.shown(name)}, ...)"
            if wrong := misplaced(form, name, what):
                raise wrong
            raise InputError(
                f"{what}: form {form.name} has {quoted(form.parameters)}"
                f"{meant(str(name), form.parameters)}"
            )
        if name not in model.compiled.used:
            raise InputError(
                f"parameter('{name}', ...): form {form.name} does not use it with its present options"
            )
        numbers, in_time, in_space = by_kind(form, {name: given})
        if name in model.in_space:
            self._to_particles(domain, name, given)
            return
        if in_space:
            raise InputError(
                f"parameter('{name}', ...): the scene was made with one number for all particles: "
                f"expected a number or a function of time, or Scene(..., {name}=...) with a field"
            )
        if in_time:
            factor = Factor(f"parameter '{name}'", in_time[name], name="", time=0.0)
            self._checked(name, factor.at(0.0), model)
            self._in_time[name] = factor
            return
        self._values[name] = self._checked(name, numbers[name], model)
        self._in_time.pop(name, None)

    def _to_particles(self, domain: Domain, name: str, source: Any) -> None:
        found = sources.values(domain, name, source, "value", "", f"parameter '{name}'")[:, 0]
        with ranks.raise_together(domain.model.grid.comm):
            for value in (found.min(), found.max()) if len(found) else ():
                self._checked(name, float(value), domain.model)
            self._border.set(name, source, f"parameter '{name}'")
        domain.particles.carried(name)[:, 0] = found

    def _checked(self, name: str, value: Any, model: Model) -> float:
        """A value within the limits of the parameter."""
        return self._form.settings({**model.options, name: value})[0][name]

    def prepare(self, domain: Domain, now: Moment, gravity: Array, dt: float | None = None) -> None:
        """Hand the form its inputs before a step; a call for all ranks.

        Args:
            domain: The particles.
            now: The end of the step.
            gravity: Acceleration then [m/s2].
            dt: Length of the step [s]; by default since the last one.

        Raises:
            InputError: The form reads dt and no time passes, or data that the scene does not have.
        """
        self._dt = now.time - self._latest if dt is None else dt
        self._hand(domain, now.time, self._dt, gravity)

    def repeat(self, domain: Domain, now: Moment, gravity: Array) -> None:
        """Hand the form its inputs at the end of the last step; a call for all ranks."""
        self._hand(domain, now.time, self._dt or 1.0, gravity)

    def share(self, now: Moment) -> float:
        """Share of the way from the present state to that at the end of a phase which a step goes."""
        done = self._part if self._part < now.part else 0.0
        return (now.part - done) / (1.0 - done)

    def finish(self, now: Moment) -> None:
        """Note that a step was stored."""
        self._latest, self._part = now.time, now.part if now.part < 1.0 else 0.0

    def _hand(self, domain: Domain, time: float, dt: float, gravity: Array) -> None:
        model = domain.model
        if "dt" in model.compiled.used and not dt > 0:
            raise InputError(
                f"form {self._form.name} reads dt, and no time passes in this step (dt = {dt:g} s): "
                "expected solve(until=...) or ramp(..., until=...) with a later time, or Dynamics(scene)"
            )
        values: dict[str, Any] = {"time": time, "dt": dt, "b": gravity}
        values |= self._values
        for name, factor in self._in_time.items():
            values[name] = self._checked(name, factor.at(time), model)
        domain.assembly.attachment.change(values)
        domain.responses.refresh()
        domain.assembly.refresh_border()
        if not self._is_checked:
            self._check_incompressible(domain)
            self._is_checked = True

    def state(self) -> dict[str, Any]:
        """Values of the parameters, for a checkpoint."""
        changing = {name: factor.identity() for name, factor in self._in_time.items()}
        passed = [self._latest, self._dt, self._part]
        return {
            "values": dict(self._values), "in time": changing, "passed": passed,
            "border": self._border.state(),
        }  # fmt: skip

    def restore(self, state: Mapping[str, Any]) -> None:
        """The reverse of :meth:`state`.

        Raises:
            CheckpointError: A parameter was another function of time.
        """
        present = {name: factor.identity() for name, factor in self._in_time.items()}
        for name, identity in state["in time"].items():
            if present.get(name) != identity:
                raise CheckpointError(
                    f"the parameter '{name}' was a function of time that the script does not give: "
                    "expected the same Scene(...) and scene.parameter(...) before the run is resumed"
                )
        self._in_time = {name: self._in_time[name] for name in state["in time"]}
        self._values |= state["values"]
        self._border.restore(state["border"])
        self._latest, self._dt, self._part = state["passed"]
