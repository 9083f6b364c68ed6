"""A static scene of small strain on its own grid or a coarser one: residuals and dual solutions."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple, cast

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from scipy.sparse.linalg import splu

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

#: Weight of coefficients that the finer ones do not determine.
REGULAR = 1e-10
#: Tolerance of further solves with the transposed tangent.
COARSE = 1e-2
#: Solves with a tangent that is nearly the one of a level.
CORRECTIONS = 4

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
            now.supports, self.domain, lambda term: term.at(moment), zero, zero, moving=False
        )
        self.external = now.loads.external(self.domain, moment)

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
        prolongation: sp.csr_matrix,
        coarse: Callable[[Array], Array],
    ) -> Array:
        """The dual solution by cycles with that on cells twice as large.

        Args:
            weights: Derivative of the quantity by all coefficients.
            coefficients: Of all fields, where the tangent is taken: those of the last residual.
            residual: The residual that the dual solution weighs.
            start: The dual solution on cells twice as large.
            prolongation: Coefficients x unknowns of these cells.
            coarse: Solves with the transposed tangent there.
        """
        reduction = self.reduction
        data = self.domain.responses.data
        tangent = self.domain.assembly.tangent(coefficients, data, reduction)
        matrix = rows_of(tangent).T
        own, right = reduction.coefficients, reduction.restricted(weights)
        found = two_grid.solve(
            matrix, int(reduction.of_displacement.sum()), prolongation[own], coarse, right,
            start[own], reduction.restricted(residual),
        )  # fmt: skip
        return reduction.expanded(splu(matrix).solve(right) if found is None else found)

    def _tangent(self, coefficients: Array) -> Any:
        """The tangent of the unknowns, a matrix of PETSc that the next one overwrites."""
        self.domain.newton.internal(coefficients)
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
            internal = self.domain.newton.internal
            zero, z = internal(np.zeros(self.layout.size)), np.zeros(self.layout.size)
            for _ in range(CORRECTIONS):
                z = z + reduction.expanded(kept(right, COARSE))
                right = reduction.restricted(weights - (internal(z) - zero))
            return z, lambda more: kept(more, COARSE)
        matrix = self._tangent(coefficients).copy().transpose()
        scale = functools.partial(Scaling(self.layout, responses).factors, matrix, reduction)
        solver = DirectSolver(self.domain.model.grid.comm, Stopwatch())
        found = solver.solve(System(matrix, scale, right, 0.0, list))
        return reduction.expanded(found), lambda more: solver.again(more, COARSE)

    def nearest(self, finer: Layout, prolongation: sp.csr_matrix, fine: Array) -> Array:
        """The coefficients that obey the supports and are next to those of a finer grid."""
        rows = np.flatnonzero(finer.active)
        offset = self.reduction.offset
        a = (prolongation @ self.reduction.selection)[rows]
        b = (fine - prolongation @ offset)[rows]
        normal = (a.T @ a + REGULAR * sp.eye(a.shape[1])).tocsc()
        return np.asarray(offset + self.reduction.expanded(splu(normal).solve(a.T @ b)))

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


def from_coarser(layout: Layout) -> sp.csr_matrix:
    """Coefficients of a layout from those of cells twice as large (two-scale relation)."""
    blocks = []
    for place in layout.fields.values():
        along: Sequence[sp.csr_matrix] = [refinement(place.basis, n) for n in layout.grid.cells]
        whole = functools.reduce(lambda inner, outer: sp.kron(outer, inner, format="csr"), along)
        blocks.append(sp.kron(whole, sp.eye(place.components), format="csr"))
    return sp.block_diag(blocks, format="csr")
