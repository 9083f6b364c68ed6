"""Solutions whose errors can be estimated."""

from __future__ import annotations

import numpy as np

from tawami.base.arrays import Array
from tawami.base.errors import InputError, NotModelledError
from tawami.conditions.load import Forces
from tawami.estimate.level import Level
from tawami.step.configuration import Configuration

#: Forces out of balance, relative to the loads, above which the state has another history.
SAME_STATE = 1e-3


def check(now: Configuration, coefficients: Array, load: float) -> None:
    """Check that the error of a solution can be estimated.

    Raises:
        InputError: The solution is not static or not that of the scene now, or the body has no border.
        NotModelledError: The scene has something that is not modelled here.
    """
    model = now.model
    if np.isnan(load):
        raise NotModelledError(
            "error(...) of a solution in motion: expected that of a static scene"
        )
    if model.moves:
        raise NotModelledError(
            f"error(...) with form {model.form.name}: expected a form of small strain: at finite strain "
            "each step has a body of its own"
        )
    if model.basis != "quadratic_spline":  # loads on the border: its points are those of cells of h
        raise NotModelledError(
            f"error(...) with basis = '{model.basis}': expected 'quadratic_spline', for which loads on "
            "the border are integrated on cells of h/2"
        )
    if model.grid.comm.size > 1:
        raise NotModelledError("error(...) on several ranks: expected one rank")
    if not np.array_equal(now.total, coefficients):
        raise InputError(
            "error(...): the scene has changed since this solution: expected the call before the next "
            "solve()"
        )
    absent = {
        "fields without a role": model.form.own_fields,
        "data of particles": model.form.data or model.in_space,
        "sums over the border": model.compiled.border,
        "walls": now.supports.walls,
        "obstacles": now.obstacles.all,
        "forces on particles": any(isinstance(load, Forces) for load in now.loads.all),
        "removed particles": now.left or now.loads.unbalanced is not None,
        "a load that is applied in part": load != 1.0,
    }
    for what, found in absent.items():
        if found:
            raise NotModelledError(
                f"error(...): the scene has {what}: expected displacement and volume as fields, "
                "supports, tractions, pressures and gravity"
            )
    if model.border is None:
        raise InputError(
            "error(...): the body has no border, within which the equations are integrated: expected "
            "Body(x, volume, border=tawami.polyline(corners))"
        )


def check_state(own: Level, coefficients: Array, form: Array, plain: Array) -> None:
    """Check that the solution obeys the supports, and that particles which were never loaded are in
    equilibrium there.

    Raises:
        NotModelledError: They are not.
    """
    if own.on_patches:
        raise NotModelledError(
            f"error(...): {own.on_patches[0].support} holds a border inside of cells: expected supports "
            "on edges of the grid, or hold(...)"
        )
    supported = own.reduction.offset + own.reduction.expanded(
        coefficients[own.reduction.coefficients]
    )
    some = own.layout.active
    if np.abs(supported - coefficients)[some].max() > SAME_STATE * np.abs(supported).max():
        raise NotModelledError(
            "error(...): the supports prescribe other displacements than the solution has: expected "
            "supports as they were in solve(); call solve() again"
        )
    n, tolerance = own.layout.num_displacement, own.domain.newton.numerics.tolerance
    size = max(np.linalg.norm((plain + own.external)[:n]), np.linalg.norm(own.external[:n]))
    if (
        np.linalg.norm(own.reduction.restricted(form)[own.reduction.of_displacement])
        > max(SAME_STATE, 10 * tolerance) * size
    ):
        raise NotModelledError(
            "error(...): the stress is not the law's response to the displacement under the present "
            "loads: expected a scene without initial stress, flow in one step, and loads and supports "
            "as they were in solve()"
        )
