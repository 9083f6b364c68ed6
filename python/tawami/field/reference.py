"""The seam between particles and field problem (contract 3 of CONTRIBUTING.md).

(form, particle densities on active cells, reduction P) -> reduced residual and tangent. This is the
reference: plain dolfinx assembly over the active cells, then P^T r and P^T K P by PETSc.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from petsc4py import PETSc

from tawami import _rust
from tawami.base import ranks
from tawami.base.petsc import Handles, aij, rows_of
from tawami.base.timing import Stopwatch
from tawami.fem import dolfinx, mesh, rules
from tawami.fem.rules import Rule
from tawami.field import ghost
from tawami.field.reduction import Layout, Reduction
from tawami.form.compilation import CompiledForm, Integral
from tawami.grid.basis import Basis
from tawami.grid.grid import Edge, Grid

Array = npt.NDArray[np.float64]
#: Sum over the particles of a spline that round-off of the assembly would drown: that of a particle 4e-7
#: of a cell inside its support. (The gradient of a Lagrange function does not vanish with it, and
#: biquadratic ones have negative sums as well.) It follows its neighbour, as if the particle were
#: not yet there; a ghost penalty gives it a stiffness.
UNRESOLVED = 1e-13


class Field:
    """A compiled form on the active cells of a grid.

    Args:
        grid: The grid.
        compiled: The form.
        basis: Basis of the displacement.
        location: Where this rank's particles are.
        volume: Their volumes [m2 per metre depth].
        parameters: Numbers that the form names (alpha, ...).
        stopwatch: Where the time of each stage goes.

    Attributes:
        layout: Where the coefficients of the fields stand.
    """

    def __init__(
        self,
        grid: Grid,
        compiled: CompiledForm,
        basis: Basis,
        location: _rust.Location,
        volume: Array,
        parameters: Mapping[str, float],
        stopwatch: Stopwatch,
    ) -> None:
        self.grid, self.compiled, self.stopwatch = grid, compiled, stopwatch
        self._location, self._volume = location, volume
        self._values = {"h": grid.h, **parameters}
        rectangle = grid.rectangle
        self._space = grid.function_space(len(compiled.form.fields), compiled.element)
        index = rectangle.ij[:, 0] + grid.cells[0] * rectangle.ij[:, 1]
        active = np.zeros(grid.cells[::-1], dtype=bool)
        active.ravel()[location.active] = True
        self._cells = np.flatnonzero(active.ravel()[index]).astype(np.int32)
        self._rows = np.searchsorted(location.active, index[self._cells]).astype(np.uint32)
        #: Whether each cell holds particles, on whichever rank, ny x nx.
        self.active = ranks.any_of(grid.comm, active)
        self.layout = Layout(grid, basis, self._space, self.active)
        if compiled.ghost is None and basis == "quadratic_spline":
            once = np.ones(len(volume))
            sums = _rust.nodal_sums(location, once, once[:, None], basis)
            self.layout.tie(ranks.sum_of(grid.comm, sums)[:, 0], UNRESOLVED)
        #: Indices of the points of each rule; none for means over cells.
        self._points: dict[Rule, list[tuple[int, int]]] = {
            rule: self._point_indices(rule) for rule in compiled.densities
        }
        self._packed: dict[int, Array] = {}
        self.reduction: Reduction | None = None
        self._ghost_matrix: sp.csr_matrix | None = None
        self._ghost_of: Any = None
        self._petsc = Handles(self, grid.comm)

    @functools.cached_property
    def _forms(self) -> dict[int, Any]:
        """The integrals over cells, attached to those with particles."""
        entities = self.grid.rectangle.entities(self._cells, None)
        return {
            id(integral): self._space.form(integral.kernel, rank, entities)
            for rank, integrals in ((1, self.compiled.residual), (2, self.compiled.tangent))
            for integral in integrals
        }

    def _point_indices(self, rule: Rule) -> list[tuple[int, int]]:
        """Indices along x and y, in the rule of one axis, of each point of dolfinx' rule."""
        points = self.grid.rectangle.to_grid_axes(rules.rule_points(rule))
        if rule == "mean":
            return []
        along = np.array([0.0, 1.0])
        if rule != "vertex":
            along, _ = _rust.gauss(round(len(points) ** 0.5))
        near = np.abs(points[:, :, None] - along[None, None, :])
        if near.min(axis=2).max() > 1e-12:
            raise RuntimeError("internal: dolfinx' quadrature is not the tensor Gauss rule")
        return [(int(a), int(b)) for a, b in near.argmin(axis=2)]

    def _pack(self, integral: Integral, nodal: Array, data: Mapping[Rule, Array]) -> Array:
        """Coefficients of the integral, one row per active cell."""
        width = integral.width
        if id(integral) not in self._packed:
            self._packed[id(integral)] = np.zeros((len(self._cells), width))
        packed = self._packed[id(integral)]
        offset = 0
        for slot in integral.slots:
            if slot.source == "fields":
                packed[:, offset : offset + slot.width] = nodal[self._space.dofs[self._cells]]
            else:
                assert slot.source != "traction"  # refused in integrals over cells
                rule = slot.source
                _rust.densities(
                    self._location, self._volume, data[slot.data], self._points[rule],
                    rule == "vertex", self._rows, list(slot.columns), offset, packed,
                )  # fmt: skip
            offset += slot.width
        return packed

    def _of_each_cell(self, integral: Integral, nodal: Array, data: Mapping[Rule, Array]) -> Array:
        """The vector that each cell gives: active cells x its degrees of freedom."""
        packed, rows = self._pack(integral, nodal, data), []
        for k in range(len(self._cells)):
            cell, vector = slice(k, k + 1), np.zeros(self._space.size)
            entities = self.grid.rectangle.entities(self._cells[cell], None)
            form = self._space.form(integral.kernel, integral.rank, entities)
            self._add_vector(vector, form, integral, packed[cell])
            rows.append(vector[self._space.dofs[self._cells[k]]])
        return np.array(rows)

    def _constants(self, integral: Integral) -> Array:
        return np.array([self._values[name] for name in integral.constants], dtype=float)

    def residual(self, coefficients: Array, data: Mapping[Rule, Array]) -> Array:
        """Internal forces and volume residual on all coefficients, before supports, on every rank.

        Args:
            coefficients: Increments of all fields.
            data: Particle data per rule, particles x columns.
        """
        vector = np.zeros(self._space.size)
        nodal = self.layout.extraction @ coefficients
        for integral in self.compiled.residual:
            with self.stopwatch("pack"):
                packed = self._pack(integral, nodal, data)
            with self.stopwatch("residual"):
                self._add_vector(vector, self._forms[id(integral)], integral, packed)
        return self._with_ghost(self._sum(self.layout.extraction.T @ vector), coefficients, data)

    def _ghost(self, data: Mapping[Rule, Array]) -> sp.csr_matrix | None:
        """The ghost penalty of the form on all coefficients, if it has one."""
        integral = self.compiled.ghost
        if integral is not None and self._ghost_matrix is None:
            with self.stopwatch("set-up"):
                self._ghost_matrix = ghost.matrix(
                    self.grid, self.layout, integral, self.active, self._location, self._volume,
                    data["mean"], self._values,
                )  # fmt: skip
        return self._ghost_matrix

    def _with_ghost(self, forces: Array, coefficients: Array, data: Mapping[Rule, Array]) -> Array:
        matrix = self._ghost(data)
        return forces if matrix is None else np.asarray(forces + matrix @ coefficients)

    def _tangent_with_ghost(
        self, matrix: Any, data: Mapping[Rule, Array], reduction: Reduction
    ) -> Any:
        """The reduced tangent and S^T G S, G the ghost penalty: one object as long as `matrix` is."""
        penalty = self._ghost(data)
        if penalty is None:
            return matrix
        with self.stopwatch("reduction"):
            if self._ghost_of is not matrix:
                self._petsc.free("ghost", "with ghost")
                own = reduction.own.stop - reduction.own.start
                reduced = (reduction.selection.T @ penalty @ reduction.selection)[reduction.own]
                self._petsc["ghost"] = aij(self.grid.comm, reduced, own)
                total = self._petsc["with ghost"] = matrix.copy()
                total.axpy(1.0, self._petsc["ghost"], PETSc.Mat.Structure.DIFFERENT_NONZERO_PATTERN)
                self._ghost_of = matrix
            else:
                total = self._petsc["with ghost"]
                total.zeroEntries()
                for part in (matrix, self._petsc["ghost"]):
                    total.axpy(1.0, part, PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN)
        return total

    def _sum(self, of_cells: Any) -> Array:
        """What the cells of all ranks give."""
        return ranks.sum_of(self.grid.comm, np.ascontiguousarray(of_cells))

    def _add_vector(self, vector: Array, form: Any, integral: Integral, packed: Array) -> None:
        constants = self._constants(integral)
        mesh.add_vector(vector, form, integral.kernel, constants, packed)

    def traction(self, edge: Edge, values: Array) -> Array:
        """External forces on all coefficients of a traction on an edge of the grid.

        Args:
            edge: Name of the edge; only its cells with particles are loaded.
            values: Traction [Pa] at the nodes of :meth:`edge_nodes`, cells x 3 x 2.
        """
        integral = self.compiled.traction
        assert integral is not None
        ij, local = self.grid.rectangle.ij, self.grid.rectangle.facet_of_edge(edge)
        axis, end = self.grid.edge(edge)
        on_edge = ij[self._cells, axis] == (self.grid.cells[axis] - 1 if end else 0)
        cells = self._cells[on_edge]
        cells = cells[self.grid.rectangle.facet_order(cells, local)]
        packed = np.zeros((len(cells), 9, 2))
        place = np.searchsorted(self.along(edge), ij[cells, 1 - axis])
        packed[:, self._nodes_on(edge)] = values[place]
        form = self._space.form(integral.kernel, 1, self.grid.rectangle.entities(cells, local))
        vector = np.zeros(self._space.size)
        self._add_vector(
            vector, form, integral, packed.reshape(len(cells), dolfinx.DISPLACEMENT_DOFS)
        )
        return -self._sum(self.layout.extraction_on(cells).T @ vector)

    def along(self, edge: Edge) -> npt.NDArray[np.int64]:
        """Numbers along an edge of its cells with particles, on whichever rank."""
        axis, end = self.grid.edge(edge)
        return np.flatnonzero(np.take(self.active, end, axis=1 - axis))

    def _nodes_on(self, edge: Edge) -> npt.NDArray[np.bool_]:
        """Which of the nine biquadratic nodes of a cell lie on its side towards an edge."""
        axis, end = self.grid.edge(edge)
        nodes = self.grid.rectangle.to_grid_axes(dolfinx.reference_nodes(2))
        return np.isclose(nodes[:, axis], 1.0 if end else 0.0)

    def edge_nodes(self, edge: Edge) -> Array:
        """Positions [m] of the biquadratic nodes of an edge: cells with particles x 3 x 2, the same on
        every rank.
        """
        axis, end = self.grid.edge(edge)
        along = self.along(edge)
        ij = np.full((len(along), 2), self.grid.cells[axis] - 1 if end else 0)
        ij[:, 1 - axis] = along
        nodes = self.grid.rectangle.to_grid_axes(dolfinx.reference_nodes(2))
        positions = ij[:, None, :] + nodes[self._nodes_on(edge)]
        return np.asarray(self.grid.origin + self.grid.h * positions)

    def tangent(self, coefficients: Array, data: Mapping[Rule, Array], reduction: Reduction) -> Any:
        """P^T K P as a PETSc matrix; it is overwritten by the next call, and stays the same object
        as long as the unknowns do.
        """
        matrix = self._assemble_tangent(coefficients, data)
        with self.stopwatch("reduction"):
            if not reduction.same_unknowns(self.reduction):
                self._petsc.free("P", "reduced")
                self.reduction = reduction
                own = reduction.own.stop - reduction.own.start
                rows = self.layout.extraction[: self._space.own] @ reduction.selection
                p = aij(self.grid.comm, rows, own)
                self._petsc["P"], self._petsc["reduced"] = p, matrix.ptap(p)
            else:
                matrix.ptap(self._petsc["P"], result=self._petsc["reduced"])
        return self._tangent_with_ghost(self._petsc["reduced"], data, reduction)

    def unreduced_tangent(self, coefficients: Array, data: Mapping[Rule, Array]) -> sp.csr_matrix:
        """E^T K E, the tangent of :meth:`residual`, whole on every rank."""
        everything = Reduction.of_all(self.layout)
        mine = rows_of(self.tangent(coefficients, data, everything)).tocoo()
        rows, columns, values = (
            ranks.allgathered(self.grid.comm, part)
            for part in (mine.row + everything.own.start, mine.col, mine.data)
        )
        unknowns, shape = everything.unknowns, (self.layout.size, self.layout.size)
        return sp.csr_matrix((values, (unknowns[rows], unknowns[columns])), shape=shape)

    def _assemble_tangent(self, coefficients: Array, data: Mapping[Rule, Array]) -> Any:
        """K on the degrees of freedom of the mesh."""
        with self.stopwatch("tangent"):
            if "full" not in self._petsc:
                self._petsc["full"] = self._space.create_matrix(self._cells)
            matrix = self._petsc["full"]
            matrix.zeroEntries()
        nodal = self.layout.extraction @ coefficients
        for integral in self.compiled.tangent:
            with self.stopwatch("pack"):
                packed = self._pack(integral, nodal, data)
            with self.stopwatch("tangent"):
                form, constants = self._forms[id(integral)], self._constants(integral)
                mesh.add_matrix(matrix, form, integral.kernel, constants, packed)
        for left, right in self.compiled.couplings:
            sides = [self._of_each_cell(integral, nodal, data) for integral in (left, right)]
            for dofs, row, column in zip(self._space.dofs[self._cells], *sides, strict=True):
                dofs = dofs.astype(np.int32)
                matrix.setValuesLocal(dofs, dofs, np.outer(row, column), addv=True)
        matrix.assemble()
        return matrix
