"""The contract of a weak form: what a file in `forms/` declares.

A form declares `fields`, `kinematics`, optionally `parameters`, `options`, `strain` and `whole_cells`,
and a function `residual` whose arguments are picked by their names:

========================= ========================================================================
the fields, the tests     u, w, eps_v, q, ... as declared in `fields`
sigma, s, sigma_m         in-plane stress, its (three-dimensional) deviator, mean stress: of the law
P, P_s, tau_m, ln_J       instead of these with `strain = "finite"`: tau f^-T, s f^-T and ln det f of the
                          step, f = I + grad u, tau = s + tau_m I the Kirchhoff stress of the law;
                          `K * ln_J` works
K, mu                     bulk and shear modulus of the particle; `K**2 / mu`, `1 / K` work
sum_p(D, f), sum_p(f)     sum over particles of V_p D_p : f(x_p), and of V_p f(x_p); exact for f up
                          to degree 4 along x and along y (a warning tells of more)
sum_c(D, f), sum_c(f)     the same with f taken at the centre of the particle's cell
sum_v(D, f), sum_v(f)     the same with f taken at the vertices of the particle's cell and summed with
                          the weights of the bilinear functions: q eps_v is row-sum lumped
cell_mean(D)              volume-weighted mean over the particles of each cell
dx, dx_c, ds              area of the cells with particles (full rule, one point); loaded edges
dG, facet_mean(D)         sides that partly filled cells share with others, and cell_mean(D) there
jump_n(f), jump_nn(f)     across these sides, the jump of the first and second normal derivative of a
                          field or test function: for ghost penalties, linear in the fields
t, h                      traction [Pa], cell size [m]
parameters, options       alpha, ...: as declared
========================= ========================================================================

Particle data enter as volume-weighted densities on the points of a fixed rule; there is exactly one
in each `sum_p`, which makes the integral equal to the sum over the particles (README,
The method). The tangent is derived (`tawami.form.compilation`).
"""

from __future__ import annotations

import functools
import hashlib
import importlib.util
import inspect
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from numbers import Real
from pathlib import Path
from types import ModuleType
from typing import Any, NoReturn

from tawami.base.checks import TEXT, number, one_of, real, shown
from tawami.base.checks import path as as_path
from tawami.base.errors import FormError, InputError
from tawami.form.kinematics import (
    FIELD_UNITS,
    KINEMATICS,
    STRAIN_MEASURES,
    Kinematics,
    StrainMeasure,
)
from tawami.form.quantities import COMPONENTS

#: The shipped forms, `tawami/forms`.
SHIPPED = Path(__file__).parents[1] / "forms"
NOTHING: Mapping[str, Any] = {}
#: What a parameter may declare.
LIMITS = ("default", "minimum", "maximum", "usual")
#: Names that every form has.
RESERVED = frozenset(
    (
        *COMPONENTS, "K", "mu", "t", "h", "dx", "dx_c", "ds", "dG", "sum_p", "sum_c", "sum_v",
        "cell_mean", "facet_mean", "jump_n", "jump_nn",
    )
)  # fmt: skip


@dataclass(frozen=True, eq=False, init=False)
class Form:
    """A weak form; compared by identity.

    Args:
        fields: Unknowns: name -> (kind, name of the test function). Kinds are 'displacement' (in
            the basis the scene chooses), 'volumetric_strain' and 'pressure' [Pa] (both bilinear).
        kinematics: The strain that the material law receives: 'displacement', 'mixed', 'cell' or
            'deviatoric'. The attribute is a `Kinematics`.
        residual: Function that returns the residual as a UFL form.
        parameters: Numbers that may change without compiling again: name -> {"default": ...,
            "minimum": ..., "maximum": ..., "usual": ...}, the limits optional; a maximum may be
            {option: maximum}; beyond what is usual a scene warns.
        options: Choices that make a different form: name -> the possible values, default first.
        strain: 'small', or 'finite': logarithmic elastic strains, the grid reset after each step. The
            attribute is a `StrainMeasure`.
        whole_cells: Those of the options that need cells which the body fills.
        name: What messages call it.

    Raises:
        FormError: A declaration that does not fit together.
    """

    fields: Mapping[str, tuple[str, str]]
    kinematics: Kinematics
    residual: Callable[..., Any]
    parameters: Mapping[str, Mapping[str, Any]]
    options: Mapping[str, tuple[str, ...]]
    strain: StrainMeasure
    whole_cells: tuple[str, ...]
    name: str

    def __init__(
        self,
        fields: Mapping[str, tuple[str, str]],
        kinematics: str | Kinematics,
        residual: Callable[..., Any],
        parameters: Mapping[str, Mapping[str, Any]] = NOTHING,
        options: Mapping[str, tuple[str, ...]] = NOTHING,
        strain: str | StrainMeasure = "small",
        whole_cells: tuple[str, ...] = (),
        name: str = "of the driver script",
    ) -> None:
        declared = {
            "fields": fields, "residual": residual, "parameters": parameters, "options": options,
            "whole_cells": whole_cells, "name": name,
        }  # fmt: skip
        for attribute, value in declared.items():
            object.__setattr__(self, attribute, value)
        self._check_declarations()
        object.__setattr__(self, "kinematics", self._named("kinematics", kinematics, KINEMATICS))
        object.__setattr__(self, "strain", self._named("strain", strain, STRAIN_MEASURES))
        self._check()

    def _check(self) -> None:
        names = [*self.fields, *(test for _, test in self.fields.values())]
        names += [*self.parameters, *self.options, *RESERVED]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            self._fail(f"{listed(twice)} stands for two things: expected another name for one")
        self._check_limits()
        kinds = [kind for kind, _ in self.fields.values()]
        for name, (kind, _) in self.fields.items():
            if kind not in FIELD_UNITS:
                self._fail(
                    f"field '{name}' is of kind '{kind}': expected one of {listed(FIELD_UNITS)}"
                )
        if self.strain.finite and self.kinematics.deviatoric:
            self._fail(
                "strain = 'finite' with the kinematics 'deviatoric': expected 'displacement', 'mixed' "
                "or 'cell'"
            )
        wanted = ("displacement", *self.kinematics.volume_fields)
        if tuple(kinds) != wanted:
            self._fail(
                f"kinematics '{self.kinematics}' needs fields of the kinds {listed(wanted)}, in this "
                f"order; it declares {listed(kinds)}"
            )
        if not callable(self.residual):
            self._fail(f"residual = {shown(self.residual)}: expected a function")

    def _check_declarations(self) -> None:
        """Whether what is declared is of the kind that it has to be."""
        for what in ("fields", "parameters", "options"):
            declared = getattr(self, what)
            if not isinstance(declared, Mapping) or not all(isinstance(n, str) for n in declared):
                self._fail(f"{what} = {shown(declared)}: expected a mapping from names")
        for name, declared in self.fields.items():
            if not _are_names(declared) or len(declared) != 2:
                self._fail(f"field '{name}' is {shown(declared)}: expected (kind, test function)")
        for name, limits in self.parameters.items():
            if not isinstance(limits, Mapping) or "default" not in limits:
                self._fail(f"parameter '{name}' has no \"default\"")
            for limit, value in limits.items():
                numbers = list(value.values()) if isinstance(value, Mapping) else [value]
                if not all(isinstance(number, Real) for number in numbers):
                    self._fail(
                        f"parameter '{name}': {shown(limit)}: {shown(value)}: expected a number"
                    )
        for name, choices in self.options.items():
            if not _are_names(choices) or not choices:
                self._fail(
                    f"option '{name}' is {shown(choices)}: expected its values, default first"
                )
        if not _are_names(self.whole_cells):
            self._fail(f"whole_cells = {shown(self.whole_cells)}: expected names of options")

    def _named(self, what: str, given: Any, known: Mapping[str, Any]) -> Any:
        """The object that a declaration names."""
        if not isinstance(given, str | Kinematics | StrainMeasure) or str(given) not in known:
            self._fail(f"{what} = {shown(given)}: expected one of {listed(known)}")
        return known[str(given)]

    def _fail(self, message: str) -> NoReturn:
        raise FormError(f"form {self.name}: {message}")

    @staticmethod
    def load(source: str | Path | ModuleType | Form) -> Form:
        """The form of a shipped name ('u_epsv'), a file, or a module; a `Form` passes through.

        Raises:
            FormError: No such form, or a file that does not declare what a form needs.
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
        path = as_path("form", source)
        if path.suffix != ".py":
            path = SHIPPED / f"{source}.py"
            if not _is_there(path):
                raise FormError(
                    f"form '{source}' is not shipped: expected one of {listed(shipped())}, "
                    "or the path of a .py file"
                )
        elif not _is_there(path):
            raise FormError(f"form file '{source}' does not exist, or cannot be read")
        resolved = path.resolve()
        return _from_file(resolved, resolved.stat().st_mtime_ns)

    @property
    def source(self) -> str:
        """Text of the residual."""
        return source_of(self.residual)

    def identity(self) -> dict[str, Any]:
        """What tells it from another form, for checkpoints."""
        return {
            "form": self.name,
            "form source": hashlib.sha256(self.source.encode()).hexdigest(),
        }

    def settings(self, given: Mapping[str, Any]) -> tuple[dict[str, float], dict[str, str]]:
        """Parameters and options of this form, defaults filled in.

        Raises:
            InputError: An unknown name, or a value out of its limits.
        """
        parameters = {name: declared["default"] for name, declared in self.parameters.items()}
        options = {name: choices[0] for name, choices in self.options.items()}
        for name, value in given.items():
            if name in parameters:
                parameters[name] = value
            elif name in options:
                if not one_of(value, self.options[name]):
                    raise InputError(
                        f"{name} = {shown(value)}: expected one of {listed(self.options[name])}"
                    )
                options[name] = value
            else:
                known = [*parameters, *options]
                has = f"it has {listed(known)}" if known else "it has none"
                raise InputError(f"form {self.name} has no parameter '{name}': {has}")
        return {n: self._limited(n, v, options) for n, v in parameters.items()}, options

    def _check_limits(self) -> None:
        """Whether parameters declare what is looked at only: another word would limit nothing."""
        for name, limits in self.parameters.items():
            unknown = [key for key in limits if key not in LIMITS]
            if unknown:
                expected = f"expected among {listed(LIMITS)}"
                self._fail(f"parameter '{name}' declares {listed(unknown)}: {expected}")

    def unusual(self, parameters: Mapping[str, float]) -> list[str]:
        """What to say of parameters beyond their usual range."""
        return [
            f"{name} = {value:g}: expected at most {self.parameters[name]['usual']:g}, beyond which the "
            f"answers of form {self.name} are far off; use a smaller {name}"
            for name, value in parameters.items()
            if value > self.parameters[name].get("usual", math.inf)
        ]

    def _limited(self, name: str, value: Any, options: Mapping[str, str]) -> float:
        """The value of a parameter, within its limits."""
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
    """Whether it is a sequence of names."""
    sequence = isinstance(value, Sequence) and not isinstance(value, TEXT)
    return sequence and all(isinstance(name, str) for name in value)


def _is_there(path: Path) -> bool:
    try:
        return path.exists()
    except OSError:  # a name too long, a folder without permission
        return False


def source_of(function: Callable[..., Any]) -> str:
    """Text of a function; its byte code where there is no text."""
    try:
        return inspect.getsource(function)
    except (OSError, TypeError):
        code = getattr(function, "__code__", None)
        return type(function).__name__ if code is None else code.co_code.hex()


def shipped() -> list[str]:
    """Names of the forms that come with tawami."""
    return sorted(path.stem for path in SHIPPED.glob("[!_]*.py"))


@functools.cache
def _from_file(path: Path, _modified: int) -> Form:
    specification = importlib.util.spec_from_file_location(f"tawami_form_{path.stem}", path)
    assert specification is not None
    assert specification.loader is not None
    module = importlib.util.module_from_spec(specification)
    try:
        specification.loader.exec_module(module)
    except Exception as error:
        raise FormError(f"form file '{path.name}' cannot be read: {error!r}") from error
    return _from_module(module, getattr(module, "residual", None), f"'{path.stem}'")


@functools.cache
def _from_module(module: ModuleType, _residual: Any, name: str | None = None) -> Form:
    """The form of a module; another one once the module is reloaded with another residual."""
    missing = [n for n in ("fields", "kinematics", "residual") if not hasattr(module, n)]
    name = name or f"'{module.__name__}'"
    if missing:
        raise FormError(f"form {name} declares no {listed(missing)}: see tawami.form.form")
    return Form(
        fields=module.fields,
        kinematics=module.kinematics,
        residual=module.residual,
        parameters=getattr(module, "parameters", {}),
        options=getattr(module, "options", {}),
        strain=getattr(module, "strain", "small"),
        whole_cells=getattr(module, "whole_cells", ()),
        name=name,
    )


def listed(names: Any) -> str:
    """Names in quotes, for messages."""
    return ", ".join(f"'{name}'" for name in names)
