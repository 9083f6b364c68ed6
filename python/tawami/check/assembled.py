"""Checks of residual and tangent of random particles, and of the equations of the user's fields."""

from __future__ import annotations

import warnings

import numpy as np

from tawami.base.errors import FormError, InexactSumWarning
from tawami.check import fields, scenes, trial
from tawami.check.report import DIFFERENCES, ROUND_OFF, UNIFORM, Check, Found, Verdict, judged
from tawami.check.trial import Settings
from tawami.form.form import Form


def symmetry(form: Form, given: Settings) -> Found:
    """Symmetry of the tangent."""
    scene = scenes.cloud(form, given)
    tangent = scene.tangent(np.zeros(scene.num_coefficients), dt=1.0)
    asymmetry = abs(tangent - tangent.T).max() / abs(tangent).max()
    words = f"|K - K^T| / |K| of random particles: {asymmetry:.1e}"
    if asymmetry < ROUND_OFF:
        yield "pass", f"{words} (< {ROUND_OFF:g})"
    else:
        yield (
            "cost",
            f"{words}: the tangent is not symmetric, and LU takes about twice the time of LDL^T",
        )


def tangent(form: Form, given: Settings) -> Found:
    """Each block of the tangent, compared with differences of the residual, at several dt."""
    plastic = "plastic law"
    if scenes.preserves_volume(form, given):
        plastic += " that preserves the volume (the form has no eps_p)"
    steps = trial.steps(form, given)
    at = f", dt = {', '.join(f'{dt:g}' for dt in steps)} s" if len(steps) > 1 else ""
    for law, name in ((None, "elastic law"), (scenes.soil(form, given), plastic)):
        errors = dict[tuple[str, str], float]()
        for dt in steps:
            for block, error in fields.tangent_errors(scenes.cloud(form, given, law), dt).items():
                errors[block] = float(np.fmax(errors.get(block, 0.0), error))
        blocks = f", {len(errors)} blocks" if len(errors) > 1 else ""
        worst = max(errors, key=lambda block: np.nan_to_num(errors[block], nan=np.inf))
        verdict, words = judged(errors[worst], DIFFERENCES, f"{name}, random particles{at}{blocks}")
        if verdict == "broken":
            words += f"; the worst is the change of the equation of '{worst[0]}' with '{worst[1]}'"
        yield verdict, words


def paths(form: Form, given: Settings) -> Found:
    """Both assemblies."""
    words = "residual and tangent, assembled at the points and by dolfinx"
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", InexactSumWarning)
        try:
            error = scenes.path_difference(form, given)
        except FormError as reason:
            cause = str(reason).splitlines()[0].split(": expected")[0]
            yield "cost", f"assembly='dolfinx', the second assembly, does not take it: {cause}"
            return
    if any(issubclass(warning.category, InexactSumWarning) for warning in caught):
        yield "cost", f"{words}: {error:.1e}; the second is not exact for this form"
    else:
        yield judged(error, ROUND_OFF, words)


def field(name: str) -> Check:
    """The check of a field without a role."""

    def check(form: Form, given: Settings) -> Found:
        unit = form.fields[name].unit
        if fields.forgets(form, given, name):
            yield (
                "broken",
                f"the flux acts on the increment of {name} alone: expected grad(old.{name} + {name})",
            )
            return
        if fields.expands(form, given, name):
            yield (
                "broken",
                f"the volume equation of increments contains the value old.{name}: the body expands in "
                f"each step at rest; expected the increment {name} alone",
            )
        found = fields.balance(form, given, name)
        words = f"a linear {name} [{unit}] at rest is in balance"
        if found.uniform > UNIFORM:
            yield (
                "cost",
                f"a uniform {name} [{unit}] changes by itself ({found.uniform:.1e} of its largest "
                "entry): right for a reaction, a source or a loss, wrong for conduction alone",
            )
        elif found.linear > UNIFORM:
            yield (
                "cost",
                f"{words} up to {found.linear:.1e} only: right for a coefficient that varies or "
                "depends on it, wrong for plain conduction",
            )
        else:
            yield "pass", f"{words}: {found.linear:.1e} (< {UNIFORM:g})"
        yield _definite(name, fields.signs(form, given, name))

    return check


def _definite(name: str, signs: list[tuple[float, str]]) -> tuple[Verdict, str]:
    """Verdict on the definiteness of the equation of a field by that field."""
    kinds = {sign for _, sign in signs}
    at = ", ".join(f"{sign} at dt = {dt:g} s" for dt, sign in signs)
    what = f"the equation of {name} by {name} is"
    if kinds in ({"positive"}, {"negative"}):
        return "pass", f"{what} definite: {kinds.pop()}, also at all dt"
    if len({kind.split()[-1] for kind in kinds} - {"zero"}) > 1:
        return "broken", (
            f"{what} {at}: the rate and the flux have opposite signs, and small differences of {name} "
            "grow; change the sign of one"
        )
    if kinds == {"zero"}:
        return (
            "cost",
            f"{what} zero: {name} is a multiplier, whose basis must suit that of the others",
        )
    return "cost", f"{what} {at}: {name} may oscillate from function to function"
