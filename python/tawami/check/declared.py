"""Checks of what a form declares: names, operators, units, options."""

from __future__ import annotations

from tawami.base.text import quoted
from tawami.check import trial, units
from tawami.check.operators import from_ufl
from tawami.check.report import Found
from tawami.check.trial import Settings
from tawami.form.form import Form
from tawami.form.lines import Lines
from tawami.form.symbols import Symbols


def declaration(form: Form, _: Settings) -> Found:
    """The fields and data of a form."""
    said = ", ".join(
        f"{name} ({field.role or f'[{field.unit}]'}, test {field.test})"
        for name, field in form.fields.items()
    )
    data = f"; data {', '.join(f'{n} [{form.data_unit(n)}]' for n in form.data)}" * bool(form.data)
    yield "pass", f"{said}{data}; kinematics {form.kinematics}, {form.strain} strain"


def parameters(form: Form, given: Settings) -> Found:
    """Parameters and options, and those beyond their usual range."""
    values, options = form.settings({})  # the defaults are within their limits
    values, options = form.settings(given)
    said = [f"{name} = {value:g}" for name, value in values.items()]
    said += [f"{name} = '{value}'" for name, value in options.items()]
    yield "pass", ", ".join(said) or "none"
    for sentence in form.unusual(values):
        yield "cost", sentence


def arguments(form: Form, given: Settings) -> Found:
    """The names of the residual, and an equation for each field."""
    _, options = form.settings(given)
    Symbols(form, options, histories=trial.histories(form)).residual()
    yield (
        "pass",
        f"all known; each of {quoted(field.test for field in form.fields.values())} has its term",
    )


def operators(form: Form, _: Settings) -> Found:
    """Operators of UFL that do not follow the geometry."""
    found, lines = from_ufl(form.residual), Lines(form.name, form.residual)
    for operator, instead, line in found:
        yield (
            "cost",
            f"{lines.text(line)}: {operator} of UFL knows plane strain only: take {instead} as an "
            "argument of residual(...) for axisymmetry too",
        )
    if not found:
        yield "pass", "each one is an argument of the residual, so that it follows the geometry"


def check_units(form: Form, given: Settings) -> Found:
    """Units of the terms."""
    _, options = form.settings(given)
    unreadable = units.unreadable(form)
    if unreadable:
        yield (
            "cost",
            f"the unit of {', '.join(unreadable)} cannot be read: expected text as 'W/(m K)'",
        )
        return
    found = list(units.contradictions(form, options, trial.histories(form)))
    for sentence, read in found:
        silent = [
            name for name in form.parameters if name in read and "unit" not in form.parameters[name]
        ]
        cause = f"; give {quoted(silent)} a \"unit\", as 'Pa s'" if silent else ""
        yield "cost", f"{sentence}: results depend on the choice of units{cause}"
    if not found:
        yield "pass", "each equation keeps its form if metre, second and kilogram are replaced"


def kernels(form: Form, given: Settings) -> Found:
    """Compilation with each choice of the options."""
    _, options = form.settings(given)
    chosen = [options]
    chosen += [{**options, name: c} for name, many in form.options.items() for c in many]
    for choice in chosen:
        trial.compiled(form, {**given, **choice})
    number = len({tuple(choice.items()) for choice in chosen})
    yield "pass", f"compiled, with {number} choice{'s' if number > 1 else ''} of its options"
