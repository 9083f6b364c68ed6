"""Checks of a weak form: properties of every correct form, measured.

`broken` makes a form unusable: it does not load, its Newton iteration cannot converge, a rotation
strains it, or it does not find a uniform stress. `cost` is everything else that a user should know: an
unsymmetric tangent (LU instead of LDL^T), locking, springs, contradicting units.

Fields without a role are checked by themselves. The mechanical checks hold them at zero. A form that
reads dt is checked at several dt, and its patch tests where rates vanish.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

from tawami.base.checks import shown
from tawami.base.errors import FormError, TawamiError
from tawami.check import assembled, declared, motions
from tawami.check.mechanics import mechanical
from tawami.check.report import Check, FormReport, Line
from tawami.check.trial import Settings
from tawami.form.form import Form


def check_form(form: str | Path | ModuleType | Form, **parameters: Any) -> FormReport:
    """Check a weak form; this takes some seconds, and longer for a new form.

    Args:
        form: Name of a shipped form, path of a file, module or `Form`.
        parameters: Values of parameters and options, instead of their defaults.

    Raises:
        InputError: The form does not have a parameter, or its value is out of its limits.
    """
    try:
        loaded = Form.load(form)
    except FormError as error:
        return FormReport(shown(form), (Line("declaration", "broken", str(error)),))
    if parameters:
        loaded.settings(parameters)
    lines, part, roots = list[Line](), mechanical(loaded), dict[str, str]()
    with warnings.catch_warnings():
        # random particles and the K/mu of the beam cause warnings on purpose
        warnings.simplefilter("ignore")
        for subject, check, needs, whole in checks_of(loaded):
            wrong = {line.subject for line in lines if line.verdict in ("broken", "not tried")}
            missing = next((need for need in needs if need in wrong), None)
            if missing is not None:
                roots[subject] = roots.get(missing, missing)
                lines.append(Line(subject, "not tried", f"it needs '{roots[subject]}' to pass"))
            else:
                lines += _tried(subject, check, loaded if whole else part, parameters)
    return FormReport(loaded.name, tuple(lines))


def _tried(subject: str, check: Check, form: Form, parameters: Settings) -> list[Line]:
    """Lines of a check; an error of tawami breaks it."""
    lines = list[Line]()
    try:
        for verdict, words in check(form, parameters):
            lines.append(Line(subject, verdict, words))
    except TawamiError as error:
        lines.append(Line(subject, "broken", str(error).splitlines()[0]))
    return lines


def checks_of(form: Form) -> Iterator[tuple[str, Check, tuple[str, ...], bool]]:
    """Subject, check, earlier checks that must not be broken, and whether all fields are meant."""
    built, right = ("kernels",), ("kernels", "tangent")
    yield "declaration", declared.declaration, (), True
    yield "parameters", declared.parameters, (), True
    yield "arguments", declared.arguments, ("parameters",), True
    yield "operators", declared.operators, ("arguments",), True
    yield "kernels", declared.kernels, ("arguments",), True
    yield "units", declared.check_units, built, True
    yield "symmetry", assembled.symmetry, built, True
    yield "tangent", assembled.tangent, built, True
    yield "dolfinx", assembled.paths, built, True
    for name in form.own_fields:
        yield f"field {name}", assembled.field(name), right, True
    yield "rigid motions", motions.rigid, built, False
    yield "patch test, displaced", motions.displaced, right, False
    yield "patch test, loaded", motions.compressed, right, False
    yield "axisymmetry", motions.axisymmetric_tangent, right, True
    yield "axisymmetry", motions.axisymmetry, right, False
    yield "stability", motions.stability, right, False
    yield "locking", motions.locking, (*right, "patch test, loaded"), False
