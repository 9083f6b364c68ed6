"""A static scene of small strain on its own grid or a coarser one: residuals and dual solutions."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple, cast

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from scipy.sparse.linalg import LinearOperator, gmres, splu

from tawami import _rust
from tawami.base.arrays import Array
from tawami.base.petsc import rows_of
from tawami.base.timing import Stopwatch
from tawami.conditions.constraints import constraints
from tawami.domain import fitting
from tawami.domain.domain import Domain
from tawami.domain.model import Model
from tawami.field.border import PointsInCells
from tawami.field.layout import Layout
from tawami.form.compilation import compile_form
from tawami.form.form import Form
from tawami.grid.basis import Basis, refinement
from tawami.particles import assignment, placement
from tawami.solve import two_grid
from tawami.solve.direct import DirectSolver
from tawami.solve.linear_solver import System
from tawami.solve.scaling import Scaling
from tawami.step.configuration import Configuration

#: Tolerance of further solves with the transposed tangent.
COARSE = 1e-2
#: Corrections of a solve with a tangent that is nearly the one of a level.
CORRECTIONS = 3

#: Solves a linear system for a right-hand side to a tolerance.
Solve = Callable[[Array, float], Array]


def with_volume(model: Model) -> Model:
    """The model with a field for the volume; itself if it has one."""
    if model.form.volume_field is not None:
        return model
    form = Form.load(model.form.strain.mixed_form)
    values, options = form.settings({}, static=model.density is None)
    materials = assignment.materials_of(model.given)
    compiled = compile_form(
        model.grid.comm, form, options, "points", space=model.grid.space,
        plastic_volume=any(one.pressure_dependent for one in materials),
        histories=[name for one in materials for name in one.history_names],
    )  # fmt: skip
    return replace(model, form=form, compiled=compiled, values=values)


class Points(NamedTuple):
    """Points of the whole body.

    Attributes:
        x: Positions [m].
        volume: Volumes [m2 per metre depth].
        material: Numbers of the materials.
    """

    x: Array
    volume: Array
    material: npt.NDArray[np.uint32]


class Level:
    """The scene on one grid, with particles that have not been loaded.

    Args:
        now: Supports and loads of the scene.
        model: Grid, form and laws.
        body: Its particles.

    Attributes:
        domain: The particles.
        external: Forces of the loads on all coefficients [N per metre depth].
        on_patches: Supports that no coefficient of an edge or a point expresses.
        reduction: Unknowns that the supports leave free, of the coefficients since the start.
    """

    def __init__(self, now: Configuration, model: Model, body: Points) -> None:
        particles = _rust.Particles(*body)
        particles.add_history(model.materials)
        grid, mine, location = placement.distributed(model.grid, particles, moving=False)
        model = replace(model, grid=grid, num_particles=len(body.x))
        if model.form.kinematics.has_eps_v:
            mine.add_eps_v()
        mine.add_strain(False, model.grid.geometry)
        self.domain = Domain.attach(model, mine, location, now.numerics, Stopwatch())
        fitting.fit(self.domain, now.border)
        attachment, known = self.domain.assembly.attachment, now.domain.assembly.attachment.values
        shared = {n: v for n, v in known.items() if n in attachment.values and n != "h"}
        attachment.change(shared)
        moment, zero = now.moment(), np.zeros(self.domain.layout.size)
        self.reduction, _, self.on_patches = constraints(
            now.supports, self.domain, lambda term: term.at(moment), zero, zero, moving=True
        )
        self.external = now.loads.external(self.domain, moment)

    @functools.cached_property
    def from_coarser(self) -> FromCoarser:
        """Coefficients from those of cells twice as large."""
        return FromCoarser(self.layout)

    @property
    def layout(self) -> Layout:
        """Places of the coefficients."""
        return self.domain.layout

    def residual(self, coefficients: Array, *, stabilised: bool) -> Array:
        """Forces out of balance on all coefficients.

        Args:
            coefficients: Of all fields.
            stabilised: Whether terms are included that the equations of the body do not have: those of
                the parameters that a form declares to be stabilising.
        """
        domain = self.domain
        if stabilised:
            return domain.newton.internal(coefficients) - self.external
        attachment, ghost = domain.assembly.attachment, domain.model.compiled.ghost
        in_ghost = set(ghost.constants) if ghost is not None else set[str]()
        declared = domain.model.form.parameters
        values = {n: v for n, v in attachment.values.items() if n in set(declared) - in_ghost}
        attachment.change({n: 0.0 for n in values if declared[n].get("stabilises")})
        data = domain.responses.evaluate(*self.layout.split(coefficients))
        internal = domain.assembly.forces(coefficients, data)
        attachment.change(values)
        return internal - self.external

    def dual_by_cycles(
        self,
        weights: Array,
        coefficients: Array,
        residual: Array,
        start: Array,
        whole: Level,
        coarse: Callable[[Array], Array],
    ) -> Array:
        """The dual solution by cycles with that on cells twice as large.

        Args:
            weights: Derivative of the quantity by all coefficients.
            coefficients: Of all fields, where the tangent is taken: those of the last residual.
            residual: The residual that the dual solution weighs.
            start: The dual solution on cells twice as large.
            whole: These cells.
            coarse: Solves with the transposed tangent there.
        """
        reduction, up = self.reduction, self.from_coarser
        matrix = rows_of(self._tangent(coefficients), copy=False).T
        own = reduction.coefficients

        def onto_coarse(residual: Array) -> Array:
            found = np.zeros(len(weights))
            found[own] = residual
            return np.asarray(whole.reduction.restricted(up.transposed(found)))

        def onto_fine(unknowns: Array) -> Array:
            return np.asarray(up(whole.reduction.expanded(unknowns))[own])

        right, mine = reduction.restricted(weights), reduction.restricted(residual)
        count = int(reduction.of_displacement.sum())
        found = two_grid.solve(
            matrix, count, onto_fine, onto_coarse, coarse, right, start[own], mine
        )
        return reduction.expanded(splu(matrix).solve(right) if found is None else found)

    def _tangent(self, coefficients: Array) -> Any:
        """Tangent of the unknowns at the last residual: a PETSc matrix that the next one overwrites."""
        data = self.domain.responses.data
        return self.domain.assembly.tangent(coefficients, data, self.reduction)

    def dual(
        self, weights: Array, coefficients: Array, kept: Solve | None = None
    ) -> tuple[Array, Callable[[Array], Array]]:
        """The influence z of each residual on a quantity: K^T z = weights, K the tangent.

        Args:
            weights: Derivative of the quantity by all coefficients.
            coefficients: Of all fields, where the tangent is taken.
            kept: Solves with a tangent of the same unknowns that is nearly this one, of a symmetric and
                linear problem. It saves a factorisation.

        Returns:
            z of all coefficients, and a function that solves K^T z = r for the unknowns.
        """
        reduction, responses = self.reduction, self.domain.responses
        right = reduction.restricted(weights)
        if kept is not None:
            size = (reduction.size, reduction.size)

            def action(x: Array) -> Array:
                return reduction.restricted(self.domain.newton.internal(reduction.expanded(x)))

            def again(r: Array) -> Array:
                return kept(r, COARSE)

            operator, nearly = LinearOperator(size, action), LinearOperator(size, again)
            found, _ = gmres(operator, right, M=nearly, restart=CORRECTIONS, maxiter=1, atol=0.0)
            return reduction.expanded(found), again
        self.domain.newton.internal(coefficients)
        matrix = self._tangent(coefficients).copy().transpose()
        scale = functools.partial(Scaling(self.layout, responses).factors, matrix, reduction)
        solver = DirectSolver(self.domain.model.grid.comm, Stopwatch())
        found = solver.solve(System(matrix, scale, right, 0.0, list))
        return reduction.expanded(found), lambda more: solver.again(more, COARSE)

    def smoothed(self, finer: Level, fine: Array) -> Array:
        """Coefficients that obey the supports, by means of those of a finer grid."""
        up, active = finer.from_coarser, finer.layout.active
        sums, share = (up.transposed(np.where(active, one, 0.0)) for one in (fine, 1.0))
        means = np.divide(sums, share, out=np.zeros_like(sums), where=share > 0)
        reduction = self.reduction
        return np.asarray(reduction.offset + reduction.expanded(means[reduction.coefficients]))

    def with_volume(self, form: Form, u: Array) -> Array:
        """All coefficients of a form with a field for the volume, given those of the displacement: the
        volumetric strain as its mean around each function.
        """
        domain, basis = self.domain, cast(Basis, form.fields[str(form.volume_field)].basis)
        location, grid = domain.location, domain.model.grid
        if domain.model.form.kinematics.volume_at_centre:
            location = grid.rust.place(location.cell, np.full_like(np.asarray(location.xi), 0.5))
        vectors = grid.space.vectors(u)
        slopes = PointsInCells(grid, location).slopes(domain.layout.basis)
        strain = sum(slope @ along for slope, along in zip(slopes, vectors.T, strict=True))
        columns = np.column_stack([strain, np.ones(len(strain))])
        sums, volume = domain.sums(domain.particles.volume, columns, basis).T
        return np.concatenate(
            [u, np.divide(sums, volume, out=np.zeros_like(sums), where=volume > 0)]
        )


class FromCoarser:
    """Coefficients of a layout from those of cells twice as large (two-scale relation), axis by axis."""

    def __init__(self, layout: Layout) -> None:
        cells = layout.grid.cells
        self._fields = [
            (place.components, [refinement(place.basis, n) for n in reversed(cells)])
            for place in layout.fields.values()
        ]

    def __call__(self, coarse: Array) -> Array:
        """All coefficients, given the coarse ones."""
        return self._applied(coarse, lambda along: along)

    def transposed(self, fine: Array) -> Array:
        """The transpose of that."""
        return self._applied(fine, lambda along: along.T)

    def _applied(self, values: Array, of: Callable[[sp.spmatrix], sp.spmatrix]) -> Array:
        found, start = list[Array](), 0
        for components, axes in self._fields:
            matrices = [of(one) for one in axes]
            shape = [*(one.shape[1] for one in matrices), components]
            stop = start + int(np.prod(shape))
            array, start = values[start:stop].reshape(shape), stop
            for k, matrix in enumerate(matrices):
                first = np.moveaxis(array, k, 0)
                product = matrix @ first.reshape(len(first), -1)
                array = np.moveaxis(product.reshape(-1, *first.shape[1:]), 0, k)
            found.append(array.ravel())
        return np.concatenate(found)
