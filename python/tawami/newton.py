"""Newton's method for one step, stopped by two measures (README, The method).

momentum   |R_u| / max(|f_int|, |f_ext|), norms over all displacement coefficients
volume     |R_q| / |sum_p V_p W_p q (max(|div u|, |eps_v|) + p_ref/K_p + floor)|, W = K for a field
           eps_v and 1 for a field p (then eps_v is p/K)
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from tawami import _rust
from tawami.compilation import CompiledForm
from tawami.density import Density, LawQuantity, ParticleScalar, Rule
from tawami.errors import ConvergenceError, InputError, SingularError
from tawami.field import Field
from tawami.linear import LinearSystem
from tawami.numpy_law import NumpyStage
from tawami.reduction import Reduction
from tawami.stopwatch import Stopwatch

Array = npt.NDArray[np.float64]
History = list[tuple[float, float | None]]

#: Volumetric strain below which the volume equation need not be solved any better.
STRAIN_FLOOR = 1e-7


@dataclass(frozen=True)
class Converged:
    """A converged step.

    Attributes:
        coefficients: Increments of all fields.
        history: (momentum, volume) measures of every residual, the first before any solve.
        condition: Lower estimate of the condition number of the last scaled tangent; 1 if none
            was needed.
        symmetric: Whether the last tangent was symmetric, so that LDL^T served.
    """

    coefficients: Array
    history: History
    condition: float
    symmetric: bool

    @property
    def iterations(self) -> int:
        """Number of linear solves."""
        return len(self.history) - 1


class Newton:
    """The nonlinear problem of one step.

    Args:
        field: The field side.
        compiled: The form.
        stage: The particle side.
        particles: The particles, with volumes, stresses and constants.
        constants: K and mu of each particle [Pa].
        stopwatch: Where the time goes.
        tolerance: Both measures must fall below it.
        max_iterations: Linear solves before giving up.
    """

    def __init__(
        self,
        field: Field,
        compiled: CompiledForm,
        stage: _rust.Stage | NumpyStage,
        particles: _rust.Particles,
        location: _rust.Location,
        constants: Mapping[str, Array],
        stopwatch: Stopwatch,
        *,
        tolerance: float,
        max_iterations: int,
    ) -> None:
        self.field, self.compiled, self.stage = field, compiled, stage
        self.particles, self.location, self.constants = particles, location, constants
        self.stopwatch = stopwatch
        self.tolerance, self.max_iterations = tolerance, max_iterations
        self.data = {
            rule: np.zeros((len(particles), compiled.columns(rule))) for rule in compiled.densities
        }
        self._requests: dict[Rule, list[tuple[str, str, int]]] = {r: [] for r in self.data}
        for rule, densities in compiled.densities.items():
            for density, column in densities.items():
                self._place(rule, density, column)
        volumetric = list(compiled.form.fields.values())[1:]
        self.kind = volumetric[0][0] if volumetric else None
        self._p_ref = 0.0

    def _place(self, rule: Rule, density: Density, column: int) -> None:
        if isinstance(density.quantity, LawQuantity):
            self._requests[rule].append((density.quantity.name, density.part, column))
        elif isinstance(density.quantity, ParticleScalar):
            with np.errstate(all="ignore"):
                values = density.quantity.evaluate(self.constants)
            self.data[rule][:, column] = values
            bad = np.flatnonzero(~np.isfinite(self.data[rule][:, column]))
            if len(bad):
                p = bad[0]
                raise InputError(
                    f"form {self.compiled.form.name}: '{density.quantity.text}' is not finite at "
                    f"particle {p}, where K = {self.constants['K'][p]:g} and mu = "
                    f"{self.constants['mu'][p]:g} Pa; with nu = 0.5 (K infinite) use form 'u_p', or "
                    "nu < 0.5"
                )

    def internal(self, coefficients: Array) -> Array:
        """Internal forces and volume residual on all coefficients, at given increments."""
        with self.stopwatch("law"):
            for rule, requests in self._requests.items():
                if requests:
                    fields = self.field.layout.split(coefficients)
                    self.stage.evaluate(*fields, requests, self.data[rule])
        return self.field.residual(coefficients, self.data)

    def _measures(
        self, internal: Array, external: Array, coefficients: Array, reduction: Reduction
    ) -> tuple[float, float | None]:
        n = self.field.layout.num_displacement
        free = reduction.selection.T @ (internal - external)
        of_u = reduction.unknowns < n
        scale = max(float(np.linalg.norm(f[:n])) for f in (internal, external))
        # Forces of a body that only moves rigidly are round-off: it is in equilibrium.
        modulus = np.minimum(self.constants["K"], 1e4 * self.constants["mu"]).max()
        round_off = 1e-14 * modulus * np.abs(coefficients[:n]).max() * np.sqrt(n)
        momentum = float(np.linalg.norm(free[of_u])) / scale if scale > round_off else 0.0
        if self.kind is None:
            return momentum, None
        weight, volume = self._volume_scale(coefficients)
        column = (weight * volume)[:, None]
        sums = _rust.nodal_sums(self.location, self.particles.volume, column, "bilinear")
        return momentum, float(np.linalg.norm(free[~of_u]) / np.linalg.norm(sums))

    def _volume_scale(self, coefficients: Array) -> tuple[Array, Array]:
        """Weight of the volume equation and the strains it is compared with, per particle."""
        bulk = self.constants["K"]
        strains = self.stage.volume_strains(*self.field.layout.split(coefficients))
        pressure = self.kind == "pressure"
        eps_v = strains[:, 1] / bulk if pressure else strains[:, 1]
        scale = np.maximum(np.abs(strains[:, 0]), np.abs(eps_v)) + self._p_ref / bulk + STRAIN_FLOOR
        return (np.ones_like(bulk) if pressure else bulk), scale

    def _scale(self, matrix: Any, reduction: Reduction) -> Array:
        """Factors of the unknowns: displacement by 1/sqrt(diagonal); eps_v and p are solved as
        p/mu, over the square root of mu times the volume of their function (README, The method).
        """
        layout = self.field.layout
        of_u = reduction.unknowns < layout.num_displacement
        vector = matrix.getDiagonal()
        diagonal = vector.array.copy()
        vector.destroy()
        scale = np.ones(reduction.size)
        # A zero diagonal (a function that no particle strains) is left for the solver to report.
        positive = of_u & (diagonal > 0)
        scale[positive] = 1 / np.sqrt(diagonal[positive])
        if self.kind is None:
            return scale
        bulk, mu = self.constants["K"], self.constants["mu"]
        columns = np.column_stack([np.ones_like(mu), 1 / bulk, 1 / mu])
        sums = _rust.nodal_sums(self.location, self.particles.volume, columns, "bilinear")
        sums = sums[reduction.unknowns[~of_u] - layout.num_displacement]
        volume = np.maximum(sums[:, 0], 1e-14 * self.field.grid.h**2)
        mu_i = volume / np.maximum(sums[:, 2], 1e-14 * self.field.grid.h**2 / mu.max())
        to_field = mu_i * sums[:, 1] / volume if self.kind == "volumetric_strain" else mu_i
        scale[~of_u] = np.where(to_field > 0, to_field, 1) / np.sqrt(mu_i * volume)
        return scale

    def solve(self, reduction: Reduction, external: Array) -> Converged:
        """Increments that balance the external forces.

        Args:
            reduction: What the supports leave free.
            external: External forces on all coefficients.

        Raises:
            ConvergenceError: Not below the tolerance within `max_iterations`, or not finite.
            SingularError: The tangent cannot be solved; the message names the cells.
        """
        mean_stress = self.particles.stress[:, :3].mean(axis=1)
        self._p_ref = float(np.sqrt(np.mean(mean_stress**2)))
        unknowns = np.zeros(reduction.size)
        condition, symmetric = 1.0, True
        history: History = []
        while True:
            coefficients = reduction.selection @ unknowns + reduction.offset
            internal = self.internal(coefficients)
            history.append(self._measures(internal, external, coefficients, reduction))
            measures = [m for m in history[-1] if m is not None]
            if not np.isfinite(measures).all():
                self._fail(history, "an infinite or undefined number came up")
            if max(measures) < self.tolerance:
                return Converged(coefficients, history, condition, symmetric)
            if len(history) > self.max_iterations:
                self._fail(history, "Take a smaller load, or check material and supports")
            matrix = self.field.tangent(coefficients, self.data, reduction)
            scale = self._scale(matrix, reduction)
            with LinearSystem(matrix, scale, self.stopwatch) as system:
                condition, symmetric = system.condition, system.symmetric
                if system.singular:
                    self._report_singular(system, reduction)
                right = reduction.selection.T @ (external - internal)
                unknowns += system.solve(right)

    def _fail(self, history: History, advice: str) -> None:
        rows = "; ".join(
            f"{k}: {u:.2e}" + ("" if q is None else f", {q:.2e}")
            for k, (u, q) in enumerate(history)
        )
        raise ConvergenceError(
            f"Newton did not converge in {len(history) - 1} iterations to {self.tolerance:g}; "
            f"measures of momentum and volume by iteration: {rows}. Nothing was changed in the "
            f"particles. {advice}",
            history,
        )

    def _report_singular(self, system: LinearSystem, reduction: Reduction) -> None:
        layout, grid = self.field.layout, self.field.grid
        counts = np.bincount(self.location.cell, minlength=grid.cells[0] * grid.cells[1])
        weakest: list[str] = []
        for unknown in system.suspects[:20]:
            cells = layout.cells_of(reduction.unknowns[unknown])
            number = counts[cells @ [1, grid.cells[0]]]
            i, j = cells[number.argmin()]
            text = f"({i}, {j}) with {number.min()} particles"
            if text not in weakest:
                weakest.append(text)
        stiff = float((self.constants["K"] / self.constants["mu"]).max())
        if stiff > 1e9 and self.compiled.form.kinematics in ("displacement", "cell"):
            advice = (
                f"K/mu is {stiff:.1e}: without a field for the volume no digit is left at that; use "
                "form 'u_epsv' or 'u_p'"
            )
        else:
            advice = (
                "the particles do not stiffen every function of the grid. Use more particles per "
                "cell, the basis 'quadratic_spline', or alpha > 0"
            )
        size = "infinite" if np.isinf(system.condition) else f"{system.condition:.1e} at least"
        raise SingularError(
            f"the tangent is singular (condition number of the scaled matrix: {size}; by inverse "
            f"iteration with the factorisation). The displacement basis is '{layout.basis}'; weakest "
            f"at the cells (i, j): {', '.join(weakest[:4])}. Likely cause: {advice}"
        )
