"""Mechanical checks: rigid motions, patch tests, stability, locking."""

from __future__ import annotations

from tawami.base.errors import FormError
from tawami.check import fields, scenes, trial
from tawami.check.report import DIFFERENCES, ROUND_OFF, UNIFORM, Found, Verdict, judged
from tawami.check.trial import Settings
from tawami.form.form import Form
from tawami.grid.basis import Basis

#: Error of the mean stress in a bent beam from which a form locks: displacement only has 0.41, B-bar
#: 0.12, u_epsv 0.007. Inf-sup constant below which pressures oscillate: that of Taylor and Hood is 0.43.
BEAM, STABLE = 0.25, 0.1
#: Part of a force that is left of a drag in a long step, at most.
SLOW = 1e-3


def rigid(form: Form, given: Settings) -> Found:
    """Forces of rigid motions."""
    translation, rotation = scenes.rigid_motion(form, given)
    words = "forces over those of a strain"
    if max(translation, rotation) < ROUND_OFF:
        yield "pass", f"{words}: {max(translation, rotation):.1e} (< {ROUND_OFF:g})"
    elif translation < ROUND_OFF:
        yield judged(
            rotation,
            ROUND_OFF,
            f"a rotation: {words}",
            ": a term has grad(u) where eps(u) is right, or a stress that does not turn",
        )
    elif springs(form, given):
        yield (
            "cost",
            f"a translation meets {translation:.1e} of the {words}: springs hold the body. u is the "
            "increment of the step: springs forget the earlier steps",
        )
    else:
        yield (
            "cost",
            f"a velocity meets {translation:.1e} of the {words} (dt = 1 s), and nothing in long steps: "
            "a drag, as of a fluid at rest",
        )


def springs(form: Form, given: Settings) -> bool:
    """Whether a translation, however slow, meets forces."""
    usual, slow = (scenes.rigid_motion(form, given, dt)[0] for dt in (1.0, trial.LONG))
    return slow > max(ROUND_OFF, SLOW * usual)


def uniform(error: float, what: str) -> tuple[Verdict, str]:
    """Verdict on the error of a uniform stress: a small part may be carried by a term on purpose."""
    if UNIFORM <= error < SLOW:
        return (
            "cost",
            f"{what}: {error:.1e}: a term besides that of the stress carries so much of it",
        )
    return judged(error, UNIFORM, what)


HELD = "springs hold the body (see rigid motions), so that its stress is not uniform"


def displaced(form: Form, given: Settings) -> Found:
    """Patch test with a displaced border, at two values of nu."""
    usual = (scenes.K, scenes.MU)
    for moduli, size, text in ((usual, 1.0, ""), (scenes.STIFF, 0.02, " at nu = 0.4999")):
        error = scenes.displaced(form, given, moduli, size)
        if error > UNIFORM and springs(form, given):
            yield "not tried", HELD
            return
        yield uniform(error, f"error of the stress{text}, border displaced")


def compressed(form: Form, given: Settings) -> Found:
    """Patch test with a traction, and the part of it that rates carry."""
    cell = form.kinematics.volume_at_centre
    usual: Basis = "bilinear" if cell else "quadratic_spline"
    error = scenes.compressed(form, given, usual)
    basis = ", bilinear functions" if cell else ""
    if error > UNIFORM and springs(form, given):
        yield "not tried", HELD
        return
    yield uniform(error, f"error of the stress under a traction{basis}")
    if cell:
        error = scenes.compressed(form, given, "quadratic_spline")
        known = "a limit of B-bar: div w at the centre of a cell is not its mean (documentation, Limits)"
        yield "cost" if error > UNIFORM else "pass", f"quadratic splines: {error:.1e}, {known}"
    if trial.reads(form, given, "dt"):
        share = scenes.compressed(form, given, usual, dt=1.0)
        if share > UNIFORM:
            yield (
                "cost",
                f"in a step of 1 s, terms with dt carry {100 * share:.2g} % of the traction (viscosity)",
            )


def axisymmetry(form: Form, given: Settings) -> Found:
    """An axial translation and a uniformly stretched ring in axisymmetry."""
    try:
        error = scenes.axial_motion(form, given)
    except FormError as reason:
        yield "cost", f"for plane strain only: {str(reason).splitlines()[0]}"
        return
    if springs(form, given):
        yield "not tried", HELD
        return
    bound = 1 / trial.LONG if trial.reads(form, given, "dt") else ROUND_OFF
    yield judged(error, bound, "forces of an axial translation")
    error = scenes.stretched_ring(form, given)
    if form.kinematics.volume_at_centre:
        yield "cost", f"B-bar finds a uniform stress of a ring up to {error:.1e}"
    else:
        yield judged(error, UNIFORM, "error of the stress of a ring, border displaced")


def axisymmetric_tangent(form: Form, given: Settings) -> Found:
    """The tangent in axisymmetry."""
    try:
        scene = scenes.cloud(form, given, geometry="axisymmetric")
    except FormError:
        return
    error = max(fields.tangent_errors(scene).values())
    yield judged(error, DIFFERENCES, "tangent, random particles")


def locking(form: Form, given: Settings) -> Found:
    """A bent beam at nu near 0.5."""
    if springs(form, given):
        yield "not tried", HELD
        return
    error = scenes.bent_beam(form, given)
    words = f"error of the mean stress of a bent beam, K/mu = 1e4: {100 * error:.2g} %"
    yield ("pass", words) if error < BEAM else ("cost", f"{words}: it locks")


def stability(form: Form, given: Settings) -> Found:
    """The inf-sup constant."""
    if form.volume_field is None:
        yield "pass", "no field for the volume, so that none can oscillate; see locking"
        return
    constant = scenes.inf_sup(form, given)
    words = f"inf-sup constant of a filled block, K/mu = 1e4: {constant:.2g}"
    if constant < 0:
        yield "broken", f"{words}: negative, a term of the volume equation has the wrong sign"
    elif constant < STABLE:
        yield (
            "cost",
            f"{words} (Taylor and Hood's is 0.43): pressures oscillate; add a stabilisation",
        )
    else:
        yield "pass", f"{words} (Taylor and Hood's is 0.43)"
