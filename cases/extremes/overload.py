"""A static load that is a thousand times too large.

A linear body carries it. A perfectly plastic body cannot. A bar of Hencky material has a largest dead
load: between smooth sides tau = M ln(lambda), so that the load per area M ln(lambda) / lambda is at most
M/e, at lambda = e. An error must leave the particles unchanged. A ramp must leave them in the last
equilibrium and report the load that was reached.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from math import e
from typing import Any

import numpy as np
from mpi4py import MPI

import tawami
from cases.extremes.attempt import Attempt, attempted, untouched
from cases.verification.cantilever import beam, mpm

SUBJECT = "overload"
E, NU = 1e6, 0.3  # [Pa], [-]
M = E * (1 - NU) / ((1 + NU) * (1 - 2 * NU))  # stiffness of a bar between smooth sides [Pa]
FORMS = ("u", "u_bbar", "u_epsv", "u_p")
FINITE = ("u_finite", "u_bbar_finite", "u_epsv_finite")


def linear(form: str, factor: float) -> float:
    """Change of the cantilever's solution divided by the load."""
    answers = []
    for f in (1.0, factor):
        scene = mpm.build(form, "clamped", 4)
        scene.traction("right", (0.0, -(f - 1) * beam.P / beam.D))
        solution = scene.solve()
        answers.append((solution.stress / f, solution.displacement_of_particles / f))
    return max(float(np.abs(b - a).max() / np.abs(a).max()) for a, b in zip(*answers, strict=True))


def plastic(law: tawami.Material, factor: float) -> float:
    """A cantilever that yields: the load must be rejected, with the particles unchanged."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0.0, 0.0), h=0.25, cells=(8, 4))
    scene = tawami.Scene(grid, tawami.box(grid, grid.origin, grid.upper, per_axis=2), law)
    scene.fix("left", "x")
    scene.fix("left", "y")
    scene.traction("right", (0.0, -20.0))
    scene.solve()
    scene.traction("right", (0.0, -20.0 * (factor - 1)))
    with untouched(scene):
        scene.solve()
    return 0.0


LAWS = {
    "von Mises": lambda: tawami.von_mises(_elastic(), yield_stress=1e3),
    "Drucker-Prager": lambda: tawami.drucker_prager(_elastic(), phi=30.0, c=1e3),
    "Mohr-Coulomb": lambda: tawami.mohr_coulomb(_elastic(), phi=30.0, c=1e3),
    "Tresca": lambda: tawami.mohr_coulomb(_elastic(), phi=0.0, c=1e3),
}


def _elastic() -> tawami.Material:
    return tawami.linear_elastic(E=E, nu=NU)


def bar(form: str, load: float, **options: Any) -> tawami.Scene:
    """A bar of 4 x 2 cells between smooth sides under a dead load [Pa], in a grid five times as long."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0.0, 0.0), h=1.0, cells=(20, 2))
    body = tawami.box(grid, (0.0, 0.0), (4.0, 2.0), per_axis=3)
    scene = tawami.Scene(grid, body, _elastic(), form=form, **options)
    scene.fix("left", "x")
    scene.fix("bottom", "y")
    scene.fix("top", "y")
    scene.load(body.x[:, 0] > 3.7, (2.0 * load, 0.0))
    return scene


def at_once(form: str, factor: float) -> float:
    """The whole load on Hencky's bar in one step: rejected, with the particles unchanged."""
    scene = bar(form, factor * 1e-2 * M)
    with untouched(scene):
        scene.solve()
    return 0.0


def by_ramp(form: str, factor: float) -> tuple[float, str]:
    """A load beyond M/e on Hencky's bar by a ramp: excess of the reached load over M/e, as a share."""
    load = factor * 1e-2 * M
    scene = bar(form, load)
    try:
        tawami.ramp(scene, 0.005, stop="raise")
    except tawami.TawamiError as error:
        sentence = " ".join([str(error), *getattr(error, "__notes__", [])])
        reached = re.search(r"at ([\d.e+-]+) of the load", sentence)
        if reached is None:
            raise RuntimeError(f"the message does not tell the load reached: {sentence}") from error
        part = float(reached[1]) * load / (M / e)
        return max(0.0, part - 1), f"rejected at {part:.2f} of M/e"
    raise RuntimeError("a load beyond M/e was accepted")


def ramped(form: str, load: float) -> tuple[float, str]:
    """A load on Hencky's bar by a ramp: mean error of the stress in the half that is not loaded."""
    scene = bar(form, load)
    steps = tawami.ramp(scene, 0.05, stop="raise")
    stretch = closed_form(load)
    inner = np.array(scene.particles.x)[:, 0] < 2.0 * stretch
    error = np.abs(scene.particles.stress[inner, 0] / (load * stretch) - 1).mean()
    return float(error), f"stretched {stretch:.3g} times in {len(steps)} steps"


def closed_form(load: float) -> float:
    """The smaller solution lambda of M ln(lambda) / lambda = load, by Newton's method."""
    stretch = 1.0
    for _ in range(100):
        stretch -= (np.log(stretch) - load / M * stretch) / (1 / stretch - load / M)
    return stretch


def inside_out() -> float:
    """A bar compressed by a load that turns particles inside out in one step."""
    scene = bar("u_epsv_finite", -10 * M)
    with untouched(scene):
        scene.solve()
    return 0.0


def attempts(short: bool) -> Iterator[Attempt]:
    """Each law and form.

    Perfectly plastic body: by the upper bound theorem of limit analysis it shears off at the wall at a
    mean traction of at most c, which is 50 times the load. Linear body: round-off times a condition
    number of 1e6. Hencky's bar by a ramp: a moved body is integrated over cells that it cuts anywhere;
    this costs a spinning disc 0.11 of its mean stress (docs: cases) and B-bar 0.22 in plain tension
    (`tests/field/test_patch.py`). The load reached may exceed M/e by the same share.
    """
    for form in FORMS[::2] if short else FORMS:
        yield attempted(SUBJECT, f"elastic, {form}: 1e3", 1e-9, lambda f=form: linear(f, 1e3))
    for name, law in LAWS.items():
        for factor in (1e2, 1e3):
            setting = f"perfectly plastic, {name}: {factor:g}"
            yield attempted(SUBJECT, setting, None, lambda m=law, f=factor: plastic(m(), f))
    for form in FINITE[2:] if short else FINITE:
        bound = 0.22 if form == "u_bbar_finite" else 0.11
        for load in (0.1, -1.0) if short else (0.01, 0.1, 0.3, 0.5, 0.7, -0.1, -1.0, -3.0, -10.0):
            setting = f"Hencky's bar, {form}, ramp to {load:g} M/e"
            yield attempted(SUBJECT, setting, bound, lambda f=form, c=load: ramped(f, c * M / e))
        setting = f"Hencky's bar, {form}, 10 M"
        yield attempted(SUBJECT, f"{setting} by a ramp", bound, lambda f=form: by_ramp(f, 1e3))
        yield attempted(SUBJECT, f"{setting} at once", None, lambda f=form: at_once(f, 1e3))
    yield attempted(SUBJECT, "Hencky's bar, pressed by 10 M at once", None, inside_out)
