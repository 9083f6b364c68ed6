"""Newton's method for one step, stopped by two measures (README, The method).

momentum   |R_u| / max(|f_int|, |f_ext|, |f_inertia|), norms over all displacement coefficients; in a
           static step f_int at its beginning too, for a body that is unloaded
volume     |R_q| / |sum_p V_p W_p q (max(|div u|, |eps_v|) + p_ref/K_p + floor)|, W = K for a field
           eps_v and 1 for a field p (then eps_v is p/K)
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from mpi4py import MPI

from tawami import _rust
from tawami.base import ranks
from tawami.base.errors import ConvergenceError, SingularError
from tawami.base.petsc import clean_up
from tawami.base.timing import Stopwatch, tally
from tawami.fem.rules import Rule
from tawami.field.reduction import Reduction
from tawami.field.reference import Field
from tawami.particles.responses import Responses
from tawami.solve import diagnosis
from tawami.solve.direct import LinearSolver
from tawami.solve.inertia import Inertia
from tawami.solve.iterative import KrylovSolver
from tawami.solve.linear_solver import Blocks, Solver
from tawami.solve.numerics import Numerics

Array = npt.NDArray[np.float64]
History = list[tuple[float, float | None]]

#: Volumetric strain below which the volume equation need not be solved any better.
STRAIN_FLOOR = 1e-7


@dataclass(frozen=True)
class Converged:
    """A converged step.

    Attributes:
        coefficients: Increments of all fields.
        acceleration: At the end of a dynamic step, of each displacement coefficient [m/s2].
        forces: What supports and walls give on all coefficients [N per metre depth].
        history: (momentum, volume) measures of every residual, the first before any solve.
        krylov: FGMRES iterations of every solve; 0 where the tangent was factorised.
        condition: Estimate of the condition number of the tangent last factorised, scaled; 1 if none
            was needed.
        symmetric: Whether that tangent was symmetric, so that LDL^T served.
    """

    coefficients: Array
    acceleration: Array | None
    forces: Array
    history: History
    krylov: list[int]
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
        responses: The particle side.
        stopwatch: Where the time goes.
        numerics: How it is solved.
    """

    def __init__(
        self,
        field: Field,
        responses: Responses,
        stopwatch: Stopwatch,
        numerics: Numerics,
    ) -> None:
        self.field, self.responses, self.compiled = field, responses, responses.compiled
        self.stage, self.constants = responses.stage, responses.constants
        self.particles, self.location = responses.particles, responses.location
        self.stopwatch, self.numerics = stopwatch, numerics
        compiled, constants = self.compiled, self.constants
        volumetric = list(compiled.form.fields.values())[1:]
        self.kind = volumetric[0][0] if volumetric else None
        self._p_ref = self._started = 0.0
        self._stored: Mapping[str, Any] | None = None
        self._comm = field.grid.comm
        self._linear: Solver
        if numerics.linear_solver == "iterative":
            self._linear = KrylovSolver(self._comm, stopwatch)
        else:
            always = numerics.factorise == "always"
            self._linear = LinearSolver(self._comm, stopwatch, always=always)
        softer = np.minimum(constants["K"], 1e4 * constants["mu"])
        #: Largest moduli of the body [Pa].
        self.stiffest, self._largest_mu = (
            self._comm.allreduce(float(modulus.max(initial=0.0)), op=MPI.MAX)
            for modulus in (softer, constants["mu"])
        )

    @property
    def data(self) -> Mapping[Rule, Array]:
        """Particle data at the increments of the last residual."""
        return self.responses.data

    @property
    def bytes_per_particle(self) -> int:
        """Bytes of the particle data and the constants of one particle."""
        return self.responses.bytes_per_particle

    def keep(self) -> None:
        """Keep what :meth:`state` needs from now on; nothing is taken over from earlier steps."""
        self._stored = None
        self._linear.keep()

    def state(self) -> dict[str, Any] | None:
        """What the next steps take from the last ones: a factorisation; None if there is none."""
        factorised = self._linear.state()
        if factorised is None or self.field.reduction is None:
            return None
        return {"unknowns": self.field.reduction.digest, "factorised": factorised}

    def restore(self, state: Mapping[str, Any] | None) -> None:
        """The reverse of :meth:`state`; it takes effect with the first tangent."""
        self._stored = state

    def _remake(self, matrix: Any, reduction: Reduction) -> None:
        """The factorisation of a stored state, if the first tangent after it has the same unknowns."""
        state, self._stored = self._stored, None
        if state is not None and self._comm.size == 1 and reduction.digest == state["unknowns"]:
            self._linear.restore(state["factorised"], matrix)

    def internal(self, coefficients: Array) -> Array:
        """Internal forces and volume residual on all coefficients, at given increments."""
        data = self.responses.evaluate(*self.field.layout.split(coefficients))
        return self.field.residual(coefficients, data)

    def _measures(
        self,
        forces: tuple[Array, ...],
        out_of_balance: Array,
        coefficients: Array,
        reduction: Reduction,
        inertia: Inertia | None,
    ) -> tuple[float, float | None]:
        n = self.field.layout.num_displacement
        free = reduction.selection.T @ out_of_balance
        of_u = reduction.unknowns < n
        scale = max(self._started, *(float(np.linalg.norm(force[:n])) for force in forces))
        at_rest = False
        if not forces[1].any():
            # Forces of a body that supports move rigidly, or that coasts, are round-off, and so are
            # those of stress that is left of them. A load is none, however small; nor is what an
            # iterate gives that went further than anything sends it.
            way = moved = float(np.abs(reduction.offset[:n]).max())
            if inertia is not None:
                way = max(moved, float(np.abs(inertia.course).max(initial=0.0)))
            way = 10 * min(way, float(np.abs(coefficients[:n]).max())) + self.field.grid.h
            # all ranks take the same way
            at_rest = self._comm.bcast(scale <= 1e-14 * self.stiffest * way * np.sqrt(n))
            if at_rest and inertia is None:
                at_rest = self._moves_rigidly(coefficients[:n], moved)
        momentum = 0.0 if at_rest or scale == 0 else float(np.linalg.norm(free[of_u])) / scale
        volume = None
        if self.kind is not None:
            weight, strains = self._volume_scale(coefficients)
            sums = self.responses.sums((weight * strains)[:, None])
            volume = float(np.linalg.norm(free[~of_u]) / np.linalg.norm(sums))
        # all ranks take the same way, to the bit
        measures: tuple[float, float | None] = self._comm.bcast((momentum, volume))
        return measures

    def _moves_rigidly(self, u: Array, moved: float) -> bool:
        """Whether strains are round-off of what supports move: their forces may still be those of a soft
        part, drowned in the round-off of a stiff one.
        """
        grid, basis = self.field.grid, self.field.layout.basis
        g = np.asarray(_rust.gradients(self.location, basis, np.ascontiguousarray(u)))
        g = g.reshape(-1, 2, 2)
        strain = self.compiled.form.strain.metric_change(g)
        largest = self._comm.allreduce(float(np.abs(strain).max(initial=0.0)), op=MPI.MAX)
        return bool(moved == 0 or largest <= 1e-10 * moved / grid.h)

    def _volume_scale(self, coefficients: Array) -> tuple[Array, Array]:
        """Weight of the volume equation and the strains it is compared with, per particle."""
        bulk = self.constants["K"]
        strains = self.stage.volume_strains(*self.field.layout.split(coefficients))
        pressure = self.kind == "pressure"
        eps_v = strains[:, 1] / bulk if pressure else strains[:, 1]
        scale = np.maximum(np.abs(strains[:, 0]), np.abs(eps_v)) + self._p_ref / bulk + STRAIN_FLOOR
        return (np.ones_like(bulk) if pressure else bulk), scale

    def _scale(self, matrix: Any, reduction: Reduction) -> Array:
        """Factors of this rank's unknowns: displacement by 1/sqrt(diagonal); eps_v and p are solved
        as p/mu, over the square root of mu times the volume of their function, or of their diagonal
        where that is larger (README, The method).
        """
        layout = self.field.layout
        own = reduction.unknowns[reduction.own]
        of_u = own < layout.num_displacement
        vector = matrix.getDiagonal()
        diagonal = vector.array.copy()
        vector.destroy()
        # A softening law makes negative diagonals. A zero one (a function that no particle strains) is
        # left for the solver to report, in a scale that does not know units.
        size = np.abs(np.where(of_u, diagonal, 0.0))
        scale: Array = 1 / np.sqrt(np.where(size > 0, size, self._largest_mu))
        if self.kind is None:
            return scale
        bulk, mu = self.constants["K"], self.constants["mu"]
        sums = self.responses.sums(np.column_stack([np.ones_like(mu), 1 / bulk, 1 / mu]))
        sums = sums[own[~of_u] - layout.num_displacement]
        least = 1e-14 * self.field.grid.h**2
        volume = np.maximum(sums[:, 0], least)
        mu_i = volume / np.maximum(sums[:, 2], least / self._largest_mu)
        to_field = mu_i * sums[:, 1] / volume if self.kind == "volumetric_strain" else mu_i
        to_field = np.where(to_field > 0, to_field, 1)
        # in a cell with little of the body the stabilisation is larger than that volume
        size = np.maximum(mu_i * volume, to_field**2 * np.abs(diagonal[~of_u]))
        scale[~of_u] = to_field / np.sqrt(size)
        return scale

    def solve(
        self,
        reduction: Reduction,
        external: Array,
        inertia: Inertia | None = None,
        guess: Array | None = None,
        friction: Callable[[Array], Array] | None = None,
    ) -> Converged:
        """Increments that balance the external forces.

        Args:
            reduction: What the supports leave free.
            external: External forces on all coefficients.
            inertia: Of a dynamic step.
            guess: Increments of all fields to start from; zero without it.
            friction: Gives forces on the body (functions x 2) from what is out of balance, which is
                what supports have to give; their change with it is left out of the tangent.

        Raises:
            ConvergenceError: Not below the tolerance within `max_iterations`, or not finite.
            SingularError: The tangent cannot be solved; the message names the cells.
        """
        clean_up(self._comm)
        self.stopwatch.start()
        mean_stress = self.particles.stress[:, :3].mean(axis=1)
        squares = ranks.sum_of(self._comm, np.array([np.sum(mean_stress**2), len(mean_stress)]))
        self._p_ref = float(np.sqrt(squares[0] / squares[1]))
        self._started = 0.0
        if inertia is None and squares[0] > 0:  # a body that is unloaded ends without forces
            start = self.internal(np.zeros(len(external)))[: self.field.layout.num_displacement]
            self._started = float(np.linalg.norm(start))
        coefficients, off = _begin(reduction, guess, inertia)
        acceleration = None
        linear, history = self._linear, History()
        krylov: list[int] = []
        while True:
            try:
                internal = self.internal(coefficients)
            except _rust.InvertedError as error:
                if guess is None:
                    self._fail(history, f"Then {error}")
                guess = None  # once more from nothing
                coefficients, off = _begin(reduction, guess, inertia)
                continue
            forces: tuple[Array, ...] = (internal, external)
            rest = internal - external
            if inertia is not None and off is not None:
                acceleration = inertia.acceleration(off)
                forces += (inertia.force(acceleration, len(rest)),)
                rest += forces[-1]
            held = rest
            if inertia is not None:
                held = rest.copy()
                held[: len(inertia.impulse)] += inertia.impulse
            if friction is not None:
                n = self.field.layout.num_displacement
                rest = rest.copy()
                rest[:n] -= friction(held[:n].reshape(-1, 2)).ravel()
            with self.stopwatch("measures"):
                history.append(self._measures(forces, rest, coefficients, reduction, inertia))
            if not np.isfinite(_worst(history[-1])):
                self._fail(history, "an infinite or undefined number came up")
            if _worst(history[-1]) < self.numerics.tolerance:
                tally.steps += 1
                return Converged(
                    coefficients, acceleration, held, history, krylov, linear.condition,
                    linear.symmetric,
                )  # fmt: skip
            if len(history) > self.numerics.max_iterations:
                advice = self._lost() or "Take a smaller load, or check material and supports"
                self._fail(history, advice)
            matrix = self.field.tangent(coefficients, self.data, reduction)
            if inertia is not None:
                self._add_mass(matrix, inertia, reduction)
            if self._stored is not None:
                self._remake(matrix, reduction)
            right = -(reduction.selection.T @ rest)
            scale = functools.partial(self._scale, matrix, reduction)
            blocks = functools.partial(self._blocks, reduction)
            forcing = self._forcing(history)
            found = linear.solve(matrix, scale, right[reduction.own], forcing, blocks)
            krylov.append(linear.iterations)
            tally.newton_iterations += 1
            tally.unknowns = max(tally.unknowns, reduction.size)
            if linear.singular:
                self._report_singular(reduction, began=len(history) == 1)
            change = reduction.selection @ ranks.allgathered(self._comm, found)
            coefficients = coefficients + change
            if off is not None:
                off = off + change[: len(off)]
            self.stopwatch.lap()

    def _blocks(self, reduction: Reduction) -> Blocks:
        """What this rank's unknowns are; the rigid motions by the Greville points of their functions."""
        own = reduction.unknowns[reduction.own]
        of_u = own < self.field.layout.num_displacement
        function, along_y = np.divmod(own[of_u], 2)
        x, y = (self.field.layout.greville[function] - self.field.grid.origin).T
        rigid = [1.0 - along_y, along_y, np.where(along_y == 1, x, -y)]
        return Blocks(of_u, np.column_stack(rigid))

    def _add_mass(self, matrix: Any, inertia: Inertia, reduction: Reduction) -> None:
        """S^T M S, M the lumped mass, to the reduced tangent: a diagonal but for point constraints."""
        n = len(inertia.mass)
        mass = sp.diags(np.pad(inertia.slope * inertia.mass, (0, len(reduction.offset) - n)))
        reduced = (reduction.selection.T @ mass @ reduction.selection).tocsr()[reduction.own]
        index = np.int32
        matrix.setValuesCSR(
            reduced.indptr.astype(index), reduced.indices.astype(index), reduced.data, addv=True
        )
        matrix.assemble()

    def _forcing(self, history: History) -> float:
        """How well the next linear system is to be solved: no worse than what Newton can make of it
        (choice 2 of Eisenstat and Walker 1996), and no better than its own tolerance asks for.
        """
        now = _worst(history[-1])
        rate = now / _worst(history[-2]) if len(history) > 1 else 1.0
        return float(np.clip(0.1 * rate**2, min(0.1 * self.numerics.tolerance / now, 1e-3), 1e-3))

    def _fail(self, history: History, advice: str) -> None:
        rows = "; ".join(
            f"{k}: {u:.2e}" + ("" if q is None else f", {q:.2e}")
            for k, (u, q) in enumerate(history)
        )
        so_far = f"measures of momentum and volume by iteration: {rows}. " if history else ""
        raise ConvergenceError(
            f"Newton did not converge in {max(len(history) - 1, 0)} iterations to "
            f"{self.numerics.tolerance:g}; {so_far}Nothing was changed in the particles. {advice}",
            history,
        )

    def _report_singular(self, reduction: Reduction, *, began: bool) -> None:
        weak, advice = self._linear.weak, self._lost()
        if not advice and not began:
            advice = diagnosis.BEYOND
        self._linear.forget()
        cells = diagnosis.weakest(self.field, self.location, reduction, weak)
        raise SingularError(
            diagnosis.sentence(self.field.layout.basis, self._linear.condition, cells, advice)
        )

    def _lost(self) -> str:
        kinematics, comm = self.compiled.form.kinematics, self._comm
        return diagnosis.lost_digits(
            comm, self.constants["K"] / self.constants["mu"], kinematics
        ) or diagnosis.contrast(comm, self.constants["mu"])


def _begin(
    reduction: Reduction, guess: Array | None, inertia: Inertia | None
) -> tuple[Array, Array | None]:
    """The first iterate: increments of all fields, and what is kept of them apart (`Inertia`)."""
    unknowns = np.zeros(reduction.size) if guess is None else guess[reduction.unknowns]
    coefficients = reduction.selection @ unknowns + reduction.offset
    return coefficients, None if inertia is None else inertia.off_course(coefficients)


def _worst(measures: tuple[float, float | None]) -> float:
    """The larger of the two; not a number if one is not."""
    return float(np.max([m for m in measures if m is not None]))
