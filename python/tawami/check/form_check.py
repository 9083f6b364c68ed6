"""Checks of a weak form: properties of every correct form, measured.

A failed check makes a form unusable: it does not load, its Newton iteration cannot converge, a rigid
motion strains it, or it does not find a uniform stress. Other shortcomings are notes: an unsymmetric
tangent (LU instead of LDL^T), no term for tractions, locking.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any, Literal

import numpy as np
from mpi4py import MPI

from tawami.base.checks import shown
from tawami.base.errors import FormError, InexactSumWarning, InputError, TawamiError
from tawami.base.text import quoted
from tawami.check import scenes
from tawami.form.compilation import compile_form
from tawami.form.form import Form
from tawami.form.symbols import Symbols

Verdict = Literal["ok", "note", "FAILED", "not tried"]
#: Bounds of relative errors: of finite differences, of round-off, of uniform stresses by Newton.
DIFFERENCES, ROUND_OFF, UNIFORM = 1e-6, 1e-11, 1e-8
#: Error of the mean stress in a bent beam from which a form locks: displacement only has 0.41, B-bar
#: 0.12, u_epsv 0.007. Inf-sup constant below which pressures oscillate: that of Taylor and Hood is 0.43.
BEAM, STABLE = 0.25, 0.1


@dataclass(frozen=True)
class Line:
    """One check: its subject, its verdict, and the numbers or the reason."""

    subject: str
    verdict: Verdict
    words: str

    def __str__(self) -> str:
        return f"{self.verdict:9} {self.subject:24} {self.words}"


@dataclass(frozen=True)
class FormReport:
    """The results of :func:`check_form`; `print` shows them as a table.

    Attributes:
        name: Name of the form.
        lines: The checks in order.
    """

    name: str
    lines: tuple[Line, ...]

    @property
    def failed(self) -> tuple[Line, ...]:
        """The checks that failed."""
        return tuple(line for line in self.lines if line.verdict == "FAILED")

    @property
    def usable(self) -> bool:
        """Whether no check failed; there may be notes."""
        return not self.failed

    def line(self, subject: str) -> Line:
        """The check of a subject.

        Raises:
            InputError: No such subject.
        """
        for line in self.lines:
            if line.subject == subject:
                return line
        known = ", ".join(repr(line.subject) for line in self.lines)
        raise InputError(f"line({shown(subject)}): expected one of {known}")

    def __str__(self) -> str:
        notes = sum(line.verdict == "note" for line in self.lines)
        end = "it can be used" if self.usable else f"it cannot be used: {len(self.failed)} FAILED"
        end += f", {notes} note{'s' if notes > 1 else ''}" if notes else ""
        return "\n".join([f"form {self.name}", *map(str, self.lines), end])


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
        return FormReport(shown(form), (Line("declaration", "FAILED", str(error)),))
    if parameters:
        loaded.settings(parameters)
    lines = list[Line]()
    with warnings.catch_warnings():
        # random particles and the K/mu of the beam cause warnings on purpose
        warnings.simplefilter("ignore")
        for subject, check, needs in CHECKS:
            failed = {line.subject for line in lines if line.verdict in ("FAILED", "not tried")}
            missing = next((need for need in needs if need in failed), None)
            if missing is not None:
                lines.append(Line(subject, "not tried", f"it needs a check that failed: {missing}"))
            else:
                lines += _tried(subject, check, loaded, parameters)
    return FormReport(loaded.name, tuple(lines))


Settings = dict[str, Any]
Found = Iterator[tuple[Verdict, str]]


def _tried(
    subject: str, check: Callable[[Form, Settings], Found], form: Form, parameters: Settings
) -> list[Line]:
    """Lines of a check; an error of tawami is a failure."""
    lines = list[Line]()
    try:
        for verdict, words in check(form, parameters):
            lines.append(Line(subject, verdict, words))
    except TawamiError as error:
        lines.append(Line(subject, "FAILED", str(error).splitlines()[0]))
    return lines


def _judged(error: float, bound: float, what: str) -> tuple[Verdict, str]:
    """Verdict on a relative error with a bound."""
    good = error < bound  # NaN fails
    return (
        "ok" if good else "FAILED",
        f"{what}: {error:.1e} ({'<' if good else 'expected <'} {bound:g})",
    )


def _declaration(form: Form, _: Settings) -> Found:
    fields = ", ".join(
        f"{name} ({field.role or field.unit}, test {field.test})"
        for name, field in form.fields.items()
    )
    yield "ok", f"{fields}; kinematics {form.kinematics}, {form.strain} strain"


def _parameters(form: Form, given: Settings) -> Found:
    values, options = form.settings({})  # the defaults are within their limits
    values, options = form.settings(given)
    said = [f"{name} = {value:g}" for name, value in values.items()]
    said += [f"{name} = '{value}'" for name, value in options.items()]
    yield "ok", ", ".join(said) or "none"
    for sentence in form.unusual(values):
        yield "note", sentence


def _arguments(form: Form, given: Settings) -> Found:
    _, options = form.settings(given)
    Symbols(form, options).residual()
    yield (
        "ok",
        f"all known; each of {quoted(field.test for field in form.fields.values())} has its term",
    )


def _kernels(form: Form, given: Settings) -> Found:
    _, options = form.settings(given)
    chosen = [options]
    chosen += [{**options, name: c} for name, many in form.options.items() for c in many]
    for choice in chosen:
        compile_form(MPI.COMM_SELF, form, choice)
    number = len({tuple(choice.items()) for choice in chosen})
    yield "ok", f"compiled, with {number} choice{'s' if number > 1 else ''} of its options"


def _symmetry(form: Form, given: Settings) -> Found:
    scene = scenes.cloud(form, given)
    tangent = scene.tangent(np.zeros(scene.num_coefficients))
    asymmetry = abs(tangent - tangent.T).max() / abs(tangent).max()
    if asymmetry < ROUND_OFF:
        yield "ok", f"|K - K^T| / |K| of random particles: {asymmetry:.1e} (< {ROUND_OFF:g})"
    else:
        yield (
            "note",
            f"|K - K^T| / |K| of random particles: {asymmetry:.1e}: the tangent is not symmetric, and "
            "LU takes about twice the time of LDL^T",
        )


def _differences(form: Form, given: Settings) -> Found:
    plastic = "plastic law"
    if scenes.preserves_volume(form, given):
        plastic += " that preserves the volume (the form has no eps_p)"
    for law, name in ((None, "elastic law"), (scenes.soil(form, given), plastic)):
        scene = scenes.cloud(form, given, law)
        yield _judged(scenes.tangent_error(scene), DIFFERENCES, f"{name}, random particles")


def _rigid(form: Form, given: Settings) -> Found:
    yield _judged(scenes.rigid_motion(form, given), ROUND_OFF, "forces over those of a strain")


def _displaced(form: Form, given: Settings) -> Found:
    yield _judged(scenes.displaced(form, given), UNIFORM, "error of the stress, border displaced")


def _has_edge_term(form: Form, given: Settings) -> bool:
    return compile_form(MPI.COMM_SELF, form, form.settings(given)[1]).edges is not None


def _compressed(form: Form, given: Settings) -> Found:
    if not _has_edge_term(form, given):
        yield "note", "no term - dot(t, w) * ds: traction(...) will be rejected"
        return
    cell = form.kinematics.volume_at_centre
    error = scenes.compressed(form, given, "bilinear" if cell else "quadratic_spline")
    basis = ", bilinear functions" if cell else ""
    yield _judged(error, UNIFORM, f"error of the stress under a traction{basis}")
    if cell:
        error = scenes.compressed(form, given, "quadratic_spline")
        known = "a limit of B-bar: div w at the centre of a cell is not its mean (documentation, Limits)"
        yield "note" if error > UNIFORM else "ok", f"quadratic splines: {error:.1e}, {known}"


def _paths(form: Form, given: Settings) -> Found:
    words = "residual and tangent, assembled at the points and by dolfinx"
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", InexactSumWarning)
        error = scenes.path_difference(form, given)
    if any(issubclass(warning.category, InexactSumWarning) for warning in caught):
        yield "note", f"{words}: {error:.1e}; the second is not exact for this form"
    else:
        yield _judged(error, ROUND_OFF, words)


def _axisymmetry(form: Form, given: Settings) -> Found:
    try:
        scene = scenes.cloud(form, given, geometry="axisymmetric")
    except FormError as reason:
        yield "note", f"for plane strain only: {reason}"
        return
    yield _judged(scenes.tangent_error(scene), DIFFERENCES, "tangent, random particles")
    yield _judged(scenes.axial_motion(form, given), ROUND_OFF, "forces of an axial translation")
    error = scenes.stretched_ring(form, given)
    if form.kinematics.volume_at_centre:
        yield "note", f"B-bar finds a uniform stress of a ring up to {error:.1e}"
    else:
        yield _judged(error, UNIFORM, "error of the stress of a ring, border displaced")


def _locking(form: Form, given: Settings) -> Found:
    if not _has_edge_term(form, given):
        yield "not tried", "it needs a term - dot(t, w) * ds"
        return
    error = scenes.bent_beam(form, given)
    words = f"error of the mean stress of a bent beam, K/mu = 1e4: {100 * error:.2g} %"
    yield ("ok", words) if error < BEAM else ("note", f"{words}: it locks")


def _stability(form: Form, given: Settings) -> Found:
    if len(form.fields) == 1:
        yield "note", "no field for the volume: nothing to check; see locking"
        return
    constant = scenes.inf_sup(form, given)
    words = f"inf-sup constant of a filled block, K/mu = 1e4: {constant:.2g}"
    if constant < 0:
        yield "FAILED", f"{words}: negative, a term of the volume equation has the wrong sign"
    elif constant < STABLE:
        yield "note", f"{words} (Taylor and Hood's is 0.43): pressures oscillate"
    else:
        yield "ok", f"{words} (Taylor and Hood's is 0.43)"


Check = Callable[[Form, Settings], Found]
#: Subject, check, and earlier checks that must not have failed.
CHECKS: tuple[tuple[str, Check, tuple[str, ...]], ...] = (
    ("declaration", _declaration, ()),
    ("parameters", _parameters, ()),
    ("arguments", _arguments, ("parameters",)),
    ("kernels", _kernels, ("arguments",)),
    ("symmetry", _symmetry, ("kernels",)),
    ("tangent", _differences, ("kernels",)),
    ("rigid motions", _rigid, ("kernels",)),
    ("dolfinx", _paths, ("kernels",)),
    ("patch test, displaced", _displaced, ("kernels", "tangent")),
    ("patch test, loaded", _compressed, ("kernels", "tangent")),
    ("axisymmetry", _axisymmetry, ("kernels", "tangent")),
    ("stability", _stability, ("kernels", "tangent")),
    ("locking", _locking, ("kernels", "tangent", "patch test, loaded")),
)
