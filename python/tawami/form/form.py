"""The contract of a weak form: the declarations of a file in `forms/`.

A form declares `fields`, optionally `kinematics`, `data`, `parameters`, `options`, `strain` and
`whole_cells`, and a function `residual`. The names of its arguments select from those of
`tawami.form.symbols` (docs: forms).
"""

from __future__ import annotations

import functools
import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from numbers import Real
from pathlib import Path
from types import ModuleType
from typing import Any, NoReturn

from tawami.base.checks import TEXT, number, one_of, real, shown
from tawami.base.errors import FormError, InputError
from tawami.base.meaning import meaning
from tawami.base.text import meant, quoted
from tawami.form.fields import Field
from tawami.form.files import module_of
from tawami.form.kinematics import (
    KINEMATICS,
    STRAIN_MEASURES,
    Kinematics,
    StrainMeasure,
    kinematics_of,
)

#: Default of declarations that are optional.
NOTHING: Mapping[str, Any] = {}
#: Declarations of a form besides its residual; the first is required.
DECLARATIONS = (
    "fields", "kinematics", "data", "parameters", "options", "static_options", "strain", "whole_cells"
)  # fmt: skip
#: The unit at the end of the meaning of data.
UNIT = re.compile(r"\[([^\[\]]+)\]$")
#: Keys that a parameter may declare.
LIMITS = ("default", "minimum", "maximum", "usual", "unit", "stabilises")
#: Names that every form has.
RESERVED = frozenset(
    (
        *STRAIN_MEASURES["small"].quantities, *STRAIN_MEASURES["finite"].quantities,
        "K", "mu", "rho", "x", "time", "dt", "b", "h", "old", "dx", "dx_c", "dG",
        "grad", "div", "eps", "I", "dim", "sum_p", "sum_c", "sum_v", "sum_b", "cell_mean",
        "facet_mean", "jump_n", "jump_nn", "n", "dot_n",
    )
)  # fmt: skip
#: Arrays of the particles that no field and no data may be called after.
ARRAYS = frozenset(
    ("x", "eps_v", "volume", "material", "number", "stress", "displacement", "strain", "velocity",
     "acceleration", "velocity_gradient", "acceleration_gradient", "displacement_gradient")
)  # fmt: skip


@dataclass(frozen=True, eq=False, init=False)
class Form:
    """A weak form. Forms are compared by identity.

    Args:
        fields: Unknowns by name, as {"u": vector("w"), "eps_v": scalar("q", role="volumetric_strain")}:
            the displacement first.
        residual: Function that returns the residual as a UFL form.
        kinematics: Strain that the material law receives. It follows from the roles of the fields:
            'displacement' without a role, 'mixed' with 'volumetric_strain', 'deviatoric' with
            'pressure'. Only 'cell' (B-bar) must be given. The attribute is a `Kinematics`.
        data: Numbers of each particle that a scene gives with `scene.data(name, ...)`: name -> what they
            are with their unit, as {"kappa": "permeability [m2]"}.
        parameters: Numbers that may change without another compilation: name -> {"default": ...,
            "minimum": ..., "maximum": ..., "usual": ..., "unit": "Pa s"}. Only the default is required.
            A maximum may depend on an option: {option: maximum}. A scene warns of a value above the
            usual one. The unit is for `tawami form check`.
        options: Choices that make a different form: name -> the possible values, default first.
        strain: 'small', or 'finite' for logarithmic elastic strains, with a reset of the grid after each
            step. The attribute is a `StrainMeasure`.
        whole_cells: Values of options that are not stable in partially filled cells.
        static_options: Defaults of options, in place of the first value, for scenes without a density.
        name: Name in messages.

    Raises:
        FormError: The declarations are wrong or do not fit together.
    """

    fields: Mapping[str, Field]
    residual: Callable[..., Any]
    kinematics: Kinematics
    data: Mapping[str, str]
    parameters: Mapping[str, Mapping[str, Any]]
    options: Mapping[str, tuple[str, ...]]
    strain: StrainMeasure
    whole_cells: tuple[str, ...]
    static_options: Mapping[str, str]
    name: str

    def __init__(
        self,
        fields: Mapping[str, Field],
        residual: Callable[..., Any],
        kinematics: str | Kinematics | None = None,
        data: Mapping[str, str] = NOTHING,
        parameters: Mapping[str, Mapping[str, Any]] = NOTHING,
        options: Mapping[str, tuple[str, ...]] = NOTHING,
        strain: str | StrainMeasure = "small",
        whole_cells: tuple[str, ...] = (),
        static_options: Mapping[str, str] = NOTHING,
        name: str = "of the driver script",
    ) -> None:
        declared = {
            "fields": fields, "residual": residual, "data": data, "parameters": parameters,
            "options": options, "whole_cells": whole_cells, "static_options": static_options,
            "name": name,
        }  # fmt: skip
        for attribute, value in declared.items():
            object.__setattr__(self, attribute, value)
        self._check_declarations()
        self._check_fields()
        given = kinematics_of(self.fields) if kinematics is None else kinematics
        object.__setattr__(self, "kinematics", self._named("kinematics", given, KINEMATICS))
        object.__setattr__(self, "strain", self._named("strain", strain, STRAIN_MEASURES))
        self._check_limits()
        self._check_names()
        self._check_kinematics()

    def _check_names(self) -> None:
        """Check that no name is declared twice."""
        names = [*self.fields, *(field.test for field in self.fields.values())]
        names += [*self.data, *self.parameters, *self.options, *RESERVED]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            self._fail(f"{quoted(twice)} has two meanings: expected another name for one of them")
        taken = sorted(ARRAYS.intersection((*self.own_fields, *self.data)))
        if taken:
            self._fail(f"{quoted(taken)} is an array that particles have: expected another name")

    def _check_fields(self) -> None:
        """Check the fields: the displacement first, and no role twice."""
        for name, field in self.fields.items():
            if not isinstance(field, Field):
                self._fail(
                    f"field '{name}' is {shown(field)}: expected vector('w') for the displacement, or "
                    "scalar('q', role='volumetric_strain'), scalar('r', unit='Pa'), ... (from "
                    "tawami.form import scalar, vector)"
                )
        roles = [field.role for field in self.fields.values()]
        if roles[:1] != ["displacement"]:
            self._fail(
                "the first of its fields is not the displacement: expected \"u\": vector('w') first"
            )
        twice = {role for role in roles if role is not None and roles.count(role) > 1}
        if len({*roles} & {"volumetric_strain", "pressure"}) > 1:
            twice |= {"volumetric_strain", "pressure"}
        if twice:
            names = [name for name, field in self.fields.items() if field.role in twice]
            self._fail(
                f"fields {quoted(names)} have the roles {quoted(sorted(twice))}: expected one "
                "displacement, and at most one other field that the law receives"
            )

    def _check_kinematics(self) -> None:
        """Check that the kinematics take the roles of the fields."""
        if self.strain.finite and self.kinematics.deviatoric:
            self._fail("strain = 'finite' with a field of the role 'pressure': expected 'small'")
        fits = kinematics_of(self.fields)
        if fits != str(self.kinematics) and not (
            self.kinematics.volume_at_centre and not self.volume_field
        ):
            self._fail(
                f"kinematics '{self.kinematics}' does not take the roles of its fields, which make it "
                f"'{fits}': expected no kinematics, or other roles"
            )
        if not callable(self.residual):
            self._fail(f"residual = {shown(self.residual)}: expected a function")

    @property
    def volume_field(self) -> str | None:
        """Name of the field with the role of the volumetric strain or of a pressure."""
        roles = ("volumetric_strain", "pressure")
        return next((name for name, field in self.fields.items() if field.role in roles), None)

    def data_unit(self, name: str) -> str:
        """Unit of data."""
        match = UNIT.search(self.data[name])
        return match.group(1) if match else "-"

    @property
    def own_fields(self) -> dict[str, Field]:
        """The fields without a role."""
        return {name: field for name, field in self.fields.items() if field.own}

    def _check_declarations(self) -> None:
        """Check the types of all declarations."""
        for what in ("fields", "data", "parameters", "options", "static_options"):
            declared = getattr(self, what)
            if not isinstance(declared, Mapping) or not all(isinstance(n, str) for n in declared):
                self._fail(f"{what} = {shown(declared)}: expected a mapping from names")
        for name, what in self.data.items():
            if not isinstance(what, str) or not UNIT.search(what):
                self._fail(
                    f"data '{name}' is {shown(what)}: expected its meaning with a unit in brackets, as "
                    "'permeability [m2]'"
                )
        for name, limits in self.parameters.items():
            if not isinstance(limits, Mapping) or "default" not in limits:
                self._fail(f"parameter '{name}' has no \"default\"")
            for limit, value in limits.items():
                numbers = value.values() if isinstance(value, Mapping) else (value,)
                kind: Any = str if limit == "unit" else Real
                if not all(isinstance(number, kind) for number in numbers):
                    expected = "text" if limit == "unit" else "a number"
                    self._fail(
                        f"parameter '{name}': {shown(limit)}: {shown(value)}: expected {expected}"
                    )
        for name, choices in self.options.items():
            if not _are_names(choices) or not choices:
                self._fail(
                    f"option '{name}' is {shown(choices)}: expected its values, default first"
                )
        for name, value in self.static_options.items():
            if not one_of(value, self.options.get(name, ())):
                self._fail(
                    f"static_options: '{name}': {shown(value)}: expected one of the option's values"
                )
        if not _are_names(self.whole_cells):
            self._fail(f"whole_cells = {shown(self.whole_cells)}: expected names of options")

    def _named(self, what: str, given: Any, known: Mapping[str, Any]) -> Any:
        """The kinematics or strain measure of that name."""
        if not isinstance(given, str | Kinematics | StrainMeasure) or str(given) not in known:
            self._fail(f"{what} = {shown(given)}: expected one of {quoted(known)}")
        return known[str(given)]

    def _fail(self, message: str) -> NoReturn:
        raise FormError(f"form {self.name}: {message}")

    @staticmethod
    def load(source: str | Path | ModuleType | Form) -> Form:
        """Load a form.

        Args:
            source: Name of a shipped form ('u_epsv'), path of a .py file, module, or a `Form` itself.

        Raises:
            FormError: The form does not exist, or lacks a declaration.
        """
        if isinstance(source, Form):
            return source
        if isinstance(source, ModuleType):
            return _from_module(source, getattr(source, "residual", None))
        if not isinstance(source, str | Path):
            raise FormError(
                f"form = {shown(source)}: expected the name of a shipped form, the path of a .py file, "
                "a module or a Form"
            )
        module = module_of(source)
        name = f"'{Path(str(module.__file__)).stem}'"
        return _from_module(module, getattr(module, "residual", None), name)

    def identity(self) -> dict[str, Any]:
        """Facts that identify the form, for checkpoints."""
        declared = {key: getattr(self, key) for key in DECLARATIONS}
        kept = declared | {key: str(declared[key]) for key in ("kinematics", "strain")}
        return {
            "form": self.name,
            "declarations": meaning(kept),
            "residual": meaning(self.residual),
        }

    def settings(
        self, given: Mapping[str, Any], *, static: bool = False, others: Iterable[str] = ()
    ) -> tuple[dict[str, float], dict[str, str]]:
        """Parameters and options of this form, with the defaults of those that are not given.

        Args:
            given: By name.
            static: Whether the scene has no density, so that its options default to `static_options`.
            others: Names that may have been meant instead of an unknown one.

        Raises:
            InputError: A name is unknown, or a value is out of its limits.
        """
        parameters = {name: declared["default"] for name, declared in self.parameters.items()}
        options = {name: choices[0] for name, choices in self.options.items()}
        options |= self.static_options if static else {}
        for name, value in given.items():
            if name in parameters:
                parameters[name] = value
            elif name in options:
                if not one_of(value, self.options[name]):
                    raise InputError(
                        f"{name} = {shown(value)}: expected one of {quoted(self.options[name])}"
                    )
                options[name] = value
            else:
                known = [*parameters, *options]
                has = f"it has {quoted(known)}" if known else "it has none"
                hint = meant(name, (*known, *others))
                raise InputError(f"form {self.name} has no parameter '{name}': {has}{hint}")
        return {n: self._limited(n, v, options) for n, v in parameters.items()}, options

    def _check_limits(self) -> None:
        """Check that parameters declare known keys only: another key would limit nothing."""
        for name, limits in self.parameters.items():
            unknown = [key for key in limits if key not in LIMITS]
            if unknown:
                expected = f"expected among {quoted(LIMITS)}"
                self._fail(f"parameter '{name}' declares {quoted(unknown)}: {expected}")

    def unusual(self, parameters: Mapping[str, float]) -> list[str]:
        """A warning for each parameter above its usual range."""
        return [
            f"{name} = {value:g}: expected at most {self.parameters[name]['usual']:g}, beyond which the "
            f"results of form {self.name} are inaccurate; use a smaller {name}"
            for name, value in parameters.items()
            if value > self.parameters[name].get("usual", math.inf)
        ]

    def _limited(self, name: str, value: Any, options: Mapping[str, str]) -> float:
        """The value of a parameter, checked against its limits."""
        limits = self.parameters[name]
        value, high = real(name, value), limits.get("maximum", math.inf)
        if isinstance(high, Mapping):
            chosen = [option for option in options.values() if option in high]
            if chosen and value > high[chosen[0]]:
                raise InputError(
                    f"{name} = {value:g} with '{chosen[0]}': expected at most {high[chosen[0]]:g}, "
                    f"beyond which form {self.name} is not stable; use a smaller {name}"
                )
            high = math.inf
        return number(name, value, low=limits.get("minimum", -math.inf), high=high)


def _are_names(value: Any) -> bool:
    """Whether a value is a sequence of strings."""
    sequence = isinstance(value, Sequence) and not isinstance(value, TEXT)
    return sequence and all(isinstance(name, str) for name in value)


@functools.cache
def _from_module(module: ModuleType, _residual: Any, name: str | None = None) -> Form:
    """The form of a module; a module that is reloaded with another residual gives another form."""
    missing = [n for n in ("fields", "residual") if not hasattr(module, n)]
    name = name or f"'{module.__name__}'"
    if missing:
        raise FormError(f"form {name} declares no {quoted(missing)}: see tawami.form.form")
    declared = {key: getattr(module, key) for key in DECLARATIONS if hasattr(module, key)}
    return Form(residual=module.residual, name=name, **declared)
