"""The measures that stop Newton's method (docs: theory).

momentum   |R_u| / max(|f_int|, |f_ext|, |f_inertia|), norms over all displacement coefficients; a static
           step also takes |f_int| at its beginning, which a body that is unloaded does not end with
volume     |R_q| / |sum_p V_p W_p q (max(|div u|, |eps_v|) + p_ref/K_p + floor)|, W = K for a field
           eps_v, and 1 for a field p (then eps_v is p/K)
field      |R_f| / max(|sum_p |R_f,p| + |f_ext||, 1e-7 |diag(K_ff) (|f| + |df|)|) of each field f without
           a role, of which the largest counts; R_f,p is the contribution of a particle, K the last
           tangent, and the first norm the largest of the iterates. The second is the size of round-off
           where the terms of the equation cancel at each particle, as in a hydrostatic equilibrium
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from tawami import _rust
from tawami.base import ranks
from tawami.base.arrays import Array
from tawami.base.petsc import diagonal_of
from tawami.field.assembly import Assembly
from tawami.field.reduction import Reduction
from tawami.particles.responses import Responses
from tawami.solve.equations import Equations
from tawami.solve.iterate import Forces

#: Measures of momentum and volume, and with fields without a role the largest of theirs; the second is
#: None without a field for the volume.
Measured = tuple[float, float | None] | tuple[float, float | None, float]
#: The measures of every residual of a step, the first before any solve.
History = list[Measured]

#: Volumetric strain that is small enough to be an error of the volume equation.
STRAIN_FLOOR = 1e-7
#: Forces and strains below these, relative to those of the motion of the body, are round-off.
NO_FORCE, NO_STRAIN = 1e-14, 1e-10
#: Share of NO_FORCE below which the residual of a body with forces on its border is round-off.
SHARE = 1e-2
#: Bound of the measures after the solve of a linear problem: the solutions of all linear solvers then
#: agree to 1e-9.
LINEAR = 1e-8
#: Measures that may be round-off, and the number of them that do not decrease then.
ROUND_OFF, STAYS = 1e-9, 5
#: Share of the diagonal times a field below which a residual of its equation is round-off.
NO_RESIDUAL = 1e-7


def worst(measures: Measured) -> float:
    """The largest of the measures; NaN if one of them is."""
    known = [measure for measure in measures if measure is not None]
    return math.nan if any(map(math.isnan, known)) else max(known)


def text(measures: Measured, digits: int = 1) -> str:
    """Measures as text, as "1.0e-03, 2.0e-05"."""
    return ", ".join(f"{measure:.{digits}e}" for measure in measures if measure is not None)


def measured(momentum: float, volume: float, *others: float) -> Measured:
    """The measures that a checkpoint stores as numbers, with NaN for a volume that is not measured."""
    of_volume = None if math.isnan(volume) else float(volume)
    if others:
        return float(momentum), of_volume, float(others[0])
    return float(momentum), of_volume


def forcing(history: History, tolerance: float, *, linear: bool = False) -> float:
    """Tolerance of the next linear solve.

    That of a linear problem reaches Newton's own tolerance at once, and at least `LINEAR`. Otherwise it
    follows the rate of convergence (choice 2 of Eisenstat and Walker 1996), as far as Newton's own
    tolerance needs it.
    """
    now = worst(history[-1])
    if linear:
        return min(0.3 * min(tolerance, LINEAR) / now, 1e-3)
    rate = now / worst(history[-2]) if len(history) > 1 else 1.0
    return min(max(0.1 * rate**2, min(0.1 * tolerance / now, 1e-3)), 1e-3)


def out_of_reach(history: History) -> str:
    """Advice if the last measures are round-off; empty if they are larger, or decrease."""
    last = [worst(measures) for measures in history[-STAYS:]]
    if len(last) < STAYS or not max(last) < min(ROUND_OFF, 10 * last[-1]):
        return ""
    expected = 10.0 ** math.ceil(math.log10(2 * max(last)))
    return (
        f"The measures stay at {max(last):.1e}, which is the round-off of this problem: expected a "
        f"tolerance of {expected:g} or more"
    )


class Measures:
    """Measures of the residuals of one step after another.

    Args:
        assembly: Residual and tangent of the form.
        responses: The particles.

    Attributes:
        worst_field: The field without a role whose last measure is the largest; None if there is none.
    """

    def __init__(self, assembly: Assembly, responses: Responses) -> None:
        self._assembly, self._responses = assembly, responses
        self._layout = assembly.layout
        self._comm = self._layout.grid.comm
        self._p_ref = self._at_start = 0.0
        self.worst_field: str | None = None
        self._own = list(responses.form.own_fields)
        self._values = self._diagonal = np.zeros(self._layout.size)
        self._largest: dict[str, float] = {}

    def begin(self, internal: Callable[[Array], Array] | None, values: Array | None = None) -> None:
        """Begin a step; a collective call.

        Args:
            internal: Internal forces at given increments, in a static step.
            values: Values of the fields at the beginning, on all coefficients; zero by default.
        """
        self._values = np.zeros(self._layout.size) if values is None else values
        self._largest = dict.fromkeys(self._own, 0.0)
        mean_stress = self._responses.particles.stress[:, :3].mean(axis=1)
        sums = np.array([np.sum(mean_stress**2), len(mean_stress)])
        squares, count = ranks.sum_of(self._comm, sums)
        self._p_ref = float(np.sqrt(squares / count))
        self._at_start = 0.0
        if internal is not None and squares > 0:
            forces = internal(np.zeros(self._layout.size))
            self._at_start = self._layout.norm(forces[: self._layout.num_displacement])

    def of(self, forces: Forces, coefficients: Array, equations: Equations) -> Measured:
        """Measures of the residuals, the same on all ranks; a collective call.

        Args:
            forces: Forces at the increments.
            coefficients: The increments.
            equations: The equations of the step.
        """
        n, reduction = self._layout.num_displacement, equations.reduction
        free = reduction.restricted(forces.residual)
        of_u = reduction.of_displacement
        parts = [forces.internal, forces.external]
        parts += [part for part in (forces.border, forces.inertia) if part is not None]
        scale = max(self._at_start, *(self._layout.norm(part[:n]) for part in parts))
        residual = self._norm(free[of_u])
        loaded = self._layout.largest(forces.external) > 0
        at_rest = not loaded and self._is_at_rest(scale, residual, coefficients[:n], equations)
        momentum = 0.0 if at_rest or scale == 0 else residual / scale
        if equations.terms is not None:
            momentum = max(momentum, equations.terms.measure)
        volume = None
        if self._responses.form.kinematics.has_mean_stress:
            location, weight = self._responses.location, self._responses.particles.volume
            sums = self._layout.functions.sums(
                location, weight, self._volume_scale(coefficients)[:, None], "bilinear"
            )
            assert self._layout.volumetric is not None
            of_volume = self._layout.volumetric.holds(reduction.coefficients)
            mine = self._layout.own[self._layout.volumetric.slice]
            with np.errstate(invalid="ignore", divide="ignore"):  # NaN without any scale
                volume = float(
                    np.divide(self._norm(free[of_volume]), self._norm(sums.ravel()[mine]))
                )
        measured: Measured = (momentum, volume)
        if self._own:
            fields = self._of_fields(free, forces, coefficients, reduction)
            # NaN counts as the largest
            self.worst_field = max(fields, key=lambda name: np.nan_to_num(fields[name], nan=np.inf))
            measured = (momentum, volume, fields[self.worst_field])
        return ranks.same(self._comm, measured)  # the same bits on all ranks

    def observe(self, tangent: Any, reduction: Reduction) -> None:
        """Keep what the measures need of a tangent that is not scaled yet; a collective call."""
        if self._own:
            sizes = np.zeros(reduction.layout.size)
            sizes[reduction.coefficients] = np.abs(diagonal_of(tangent))
            self._diagonal = reduction.layout.exchange.update(sizes)

    def _of_fields(
        self, free: Array, forces: Forces, coefficients: Array, reduction: Reduction
    ) -> dict[str, float]:
        """Measure of each field without a role."""
        magnitude = self._assembly.magnitude(coefficients, self._responses.data)
        magnitude += np.abs(forces.external)
        round_off = NO_RESIDUAL * self._diagonal * (np.abs(self._values) + np.abs(coefficients))
        measures, norm = {}, self._norm
        for name in self._own:
            mine = reduction.of_field(name)
            unknowns = reduction.coefficients[mine]
            self._largest[name] = max(self._largest[name], norm(magnitude[unknowns]))
            scale, residual = max(self._largest[name], norm(round_off[unknowns])), norm(free[mine])
            measures[name] = residual / scale if scale > 0 else residual
        return measures

    def _is_at_rest(self, scale: float, residual: float, u: Array, equations: Equations) -> bool:
        """Whether forces without a load are round-off.

        This holds for the forces of a body that supports move rigidly, or that moves freely, and for
        those of the rest of a stress. It does not hold for a small load, nor for the forces of an
        iterate that went farther than supports and velocities take the body.
        """
        offset, inertia = equations.reduction.offset[: len(u)], equations.inertia
        prescribed = self._layout.largest(offset)
        if equations.terms is not None:
            prescribed = max(prescribed, equations.terms.prescribed)
        distance = prescribed
        if inertia is not None:
            distance = max(prescribed, self._layout.largest(inertia.coasting))
        grid = self._layout.grid
        distance = 10 * min(distance, self._layout.largest(u)) + grid.h
        (thickness,) = grid.space.thickness(np.array([grid.upper]))
        largest = NO_FORCE * self._responses.stiffest * distance * thickness
        largest *= np.sqrt(next(iter(self._layout.of_grid.values())).stop)
        # positions of border points have no more digits
        round_off = equations.terms is not None and residual <= SHARE * largest
        # the same branch on all ranks
        small, round_off = ranks.same(self._comm, (bool(scale <= largest), bool(round_off)))
        if small and not round_off and inertia is None:
            return self._moves_rigidly(u, prescribed)
        return small or round_off

    def _moves_rigidly(self, u: Array, prescribed: float) -> bool:
        """Whether strains are round-off compared with the displacement that is prescribed.

        Forces alone do not tell: those of a soft part may be as small as the round-off of a stiff one.
        """
        location, basis = self._responses.location, self._layout.basis
        gradient = np.asarray(_rust.gradients(location, basis, np.ascontiguousarray(u)))
        strain = self._responses.form.strain.metric_change(
            self._layout.grid.space.gradients(gradient)
        )
        largest = ranks.largest(self._comm, float(np.abs(strain).max(initial=0.0)))
        return bool(prescribed == 0 or largest <= NO_STRAIN * prescribed / self._layout.grid.h)

    def _norm(self, own: Array) -> float:
        """Euclidean norm of vectors of this rank's own entries; a collective call."""
        return ranks.norm_of(self._comm, own)

    def _volume_scale(self, coefficients: Array) -> Array:
        """Reference value of the volume equation of each particle, without its volume."""
        bulk = self._responses.constants["K"]
        strains = self._responses.stage.volume_strains(*self._layout.split(coefficients))
        div_u, field = np.abs(strains).T
        pressure = self._responses.form.kinematics.deviatoric
        eps_v = field / bulk if pressure else field
        scale = np.maximum(div_u, eps_v) + self._p_ref / bulk + STRAIN_FLOOR
        return np.asarray(scale if pressure else bulk * scale)
