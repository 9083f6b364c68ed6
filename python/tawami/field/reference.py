"""Assembly by plain dolfinx over the active cells, then P^T r and P^T K P by PETSc."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from typing import Any

import numpy as np
import scipy.sparse as sp

from tawami import _rust
from tawami.base.arrays import Array
from tawami.base.petsc import Handles, aij
from tawami.fem import mesh
from tawami.fem.rules import Rule
from tawami.field.assembly import Assembly
from tawami.field.attachment import Attachment
from tawami.field.reduction import Reduction
from tawami.form.integral import Integral


class ReferenceAssembly(Assembly):
    """Residual and tangent by the assembly of dolfinx.

    Args:
        attachment: The form and the active cells.
    """

    def __init__(self, attachment: Attachment) -> None:
        super().__init__(attachment)
        grid, location = attachment.grid, attachment.location
        self._space = grid.function_space(attachment.compiled.element)
        number, active = grid.window.numbers(grid.rectangle.ij), location.active
        #: Active cells, as dolfinx numbers them, and the position of each in `location.active`.
        self._cells = np.flatnonzero(np.isin(number, active)).astype(np.int32)
        self._rows = np.searchsorted(active, number[self._cells]).astype(np.uint32)
        self._packed: dict[int, Array] = {}
        self._petsc = Handles(self, attachment.grid.comm)

    def forces(self, coefficients: Array, data: Mapping[Rule, Array]) -> Array:
        """See `Assembly.forces`."""
        extraction = self._extraction
        vector, nodal = np.zeros(self._space.size), extraction @ coefficients
        for integral in self._compiled.residual:
            with self._stopwatch("pack"):
                packed = self._pack(integral, nodal, data)
            with self._stopwatch("residual"):
                self._add_vector(vector, self._forms[id(integral)], integral, packed)
        return self.layout.sum(extraction.T @ vector)

    def magnitude(self, coefficients: Array, data: Mapping[Rule, Array]) -> Array:
        """See `Assembly.magnitude`; all contributions are those of cells."""
        extraction, dofs = self._extraction, self._space.dofs[self._cells]
        nodal, sums = extraction @ coefficients, np.zeros(self.layout.size)
        for integral in self._compiled.residual:
            of_cells = self._of_each_cell(integral, nodal, data)
            for of_nodes, vector in zip(dofs, of_cells, strict=True):
                sums += np.abs(extraction[of_nodes].T @ vector)
        return self.layout.sum(sums)

    def tangent(self, coefficients: Array, data: Mapping[Rule, Array], reduction: Reduction) -> Any:
        """See `Assembly.tangent`."""
        matrix = self._assemble_tangent(coefficients, data)
        with self._stopwatch("reduction"):
            if reduction.same_unknowns(self.reduction):
                matrix.ptap(self._petsc["P"], result=self._petsc["reduced"])
            else:
                self._petsc.free("P", "reduced")
                self.reduction = reduction
                rows = (self._extraction[: self._space.own] @ reduction.selection).tocoo()
                places, shape = (
                    (rows.row, reduction.number[rows.col]),
                    (rows.shape[0], reduction.size),
                )
                rows = sp.csr_matrix((rows.data, places), shape=shape)
                p = aij(self.layout.grid.comm, rows, reduction.num_own)
                self._petsc["P"], self._petsc["reduced"] = p, matrix.ptap(p)
        return self._ghost.add_tangent(self._petsc["reduced"], data, reduction)

    @functools.cached_property
    def _extraction(self) -> sp.csr_matrix:
        """E: degrees of freedom of this rank's cells x coefficients."""
        layout, dofs = self.layout, self._space.dofs
        number = layout.window.numbers(layout.grid.rectangle.ij)
        rows, columns, values, done = [], [], [], 0
        for field in layout.fields.values():
            functions, at_nodes = layout.at_nodes(field.basis, field.degree, number)
            width = at_nodes.shape[1] * field.components
            of_nodes = dofs[:, done : done + width].reshape(-1, field.components)
            done += width
            once = np.unique(of_nodes[:, 0], return_index=True)[1]  # (cell, node) of each row
            functions = functions[once // at_nodes.shape[1]]
            at_nodes = at_nodes.reshape(-1, at_nodes.shape[2])[once]
            components = np.arange(field.components)
            shape = (*functions.shape, len(components))
            columns.append(field.start + len(components) * functions[..., None] + components)
            rows.append(np.broadcast_to(of_nodes[once][:, None], shape))
            values.append(np.broadcast_to(at_nodes[..., None], shape))
        flat = [
            np.concatenate([part.ravel() for part in parts]) for parts in (values, rows, columns)
        ]
        shape = (self._space.size, layout.size)
        matrix = sp.csr_matrix((flat[0], (flat[1], flat[2])), shape=shape)
        matrix.eliminate_zeros()
        return matrix

    @functools.cached_property
    def _forms(self) -> dict[int, Any]:
        """The integrals over cells as dolfinx forms on the active cells."""
        entities = self.layout.grid.rectangle.domain(self._cells)
        return {
            id(integral): self._space.form(integral.kernel, integral.rank, entities)
            for integral in (*self._compiled.residual, *self._compiled.tangent)
        }

    def _assemble_tangent(self, coefficients: Array, data: Mapping[Rule, Array]) -> Any:
        """K on the degrees of freedom of the mesh."""
        with self._stopwatch("tangent"):
            if "full" not in self._petsc:
                self._petsc["full"] = self._space.create_matrix(self._cells)
            matrix = self._petsc["full"]
            matrix.zeroEntries()
        nodal = self._extraction @ coefficients
        for integral in self._compiled.tangent:
            with self._stopwatch("pack"):
                packed = self._pack(integral, nodal, data)
            with self._stopwatch("tangent"):
                form, constants = self._forms[id(integral)], self.attachment.constants(integral)
                mesh.add_matrix(matrix, form, integral.kernel, constants, packed)
        for left, right in self._compiled.couplings:
            sides = [self._of_each_cell(integral, nodal, data) for integral in (left, right)]
            for dofs, row, column in zip(self._space.dofs[self._cells], *sides, strict=True):
                dofs = dofs.astype(np.int32)
                matrix.setValuesLocal(dofs, dofs, np.outer(row, column), addv=True)
        matrix.assemble()
        return matrix

    def _pack(self, integral: Integral, nodal: Array, data: Mapping[Rule, Array]) -> Array:
        """Coefficients of an integral, active cells x entries."""
        attached = self.attachment
        if id(integral) not in self._packed:
            self._packed[id(integral)] = np.zeros((len(self._cells), integral.width))
        packed, offset = self._packed[id(integral)], 0
        for slot in integral.slots:
            if slot.source == "fields":
                packed[:, offset : offset + slot.width] = nodal[self._space.dofs[self._cells]]
            else:
                rule = slot.data
                _rust.densities(
                    attached.location, attached.volume, data[rule], attached.points[rule],
                    rule == "vertex", self._rows, list(slot.columns), offset, packed,
                )  # fmt: skip
            offset += slot.width
        return packed

    def _of_each_cell(self, integral: Integral, nodal: Array, data: Mapping[Rule, Array]) -> Array:
        """The vector of each cell, active cells x degrees of freedom."""
        packed, rows = self._pack(integral, nodal, data), []
        for k in range(len(self._cells)):
            cell, vector = slice(k, k + 1), np.zeros(self._space.size)
            entities = self.layout.grid.rectangle.domain(self._cells[cell])
            form = self._space.form(integral.kernel, integral.rank, entities)
            self._add_vector(vector, form, integral, packed[cell])
            rows.append(vector[self._space.dofs[self._cells[k]]])
        return np.array(rows)

    def _add_vector(self, vector: Array, form: Any, integral: Integral, packed: Array) -> None:
        constants = self.attachment.constants(integral)
        mesh.add_vector(vector, form, integral.kernel, constants, packed)
