"""Ghost penalty: the term of a form on the sides that partially filled cells share with others.

The term is linear in the fields, so it is one matrix from one reset of the grid to the next. The kernel
of FFCx for a side gives the entries of both cells at once (Burman 2010).
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import scipy.sparse as sp

from tawami import _rust
from tawami.base import ranks
from tawami.base.arrays import Array
from tawami.fem import dolfinx
from tawami.fem.kernels import Kernel
from tawami.fem.mesh import FACETS
from tawami.fem.rules import Rule
from tawami.field.attachment import Attachment
from tawami.field.reduction import Reduction
from tawami.field.sum import Sum
from tawami.form.integral import Integral

#: Difference of particle data, relative to the largest, below which sides are alike.
SAME = 1e-13


class GhostPenalty:
    """The ghost penalty of a form; without such a term, or without cut cells, it adds nothing.

    Args:
        attachment: The form and the active cells.
    """

    def __init__(self, attachment: Attachment) -> None:
        self._attachment = attachment
        self._matrix: sp.csr_matrix | None = None
        #: Values of the constants and of the particle data in it.
        self._read = np.zeros(0)
        self._sum = Sum(attachment.grid.comm)

    def add_forces(self, forces: Array, coefficients: Array, data: Mapping[Rule, Array]) -> Array:
        """Forces on all coefficients with those of the penalty.

        Args:
            forces: Forces without it.
            coefficients: Increments of all fields.
            data: Particle data of each rule.
        """
        matrix, start = self.on_all(data), self._attachment.start
        if matrix is None:
            return forces
        fields = coefficients if start is None else start + coefficients
        return np.asarray(forces + self._attachment.layout.sum(matrix @ fields))

    def add_tangent(self, tangent: Any, data: Mapping[Rule, Array], reduction: Reduction) -> Any:
        """A reduced tangent plus S^T G S, G the penalty; the same object as long as `tangent` is."""
        penalty = self.on_all(data)
        if penalty is None:
            return tangent
        with self._attachment.stopwatch("reduction"):
            return self._sum.of(tangent, penalty, reduction)

    def on_all(self, data: Mapping[Rule, Array]) -> sp.csr_matrix | None:
        """This rank's part of G, on the coefficients of the window; None without a penalty.

        G is the sum of the parts. A collective call.
        """
        if not self._attachment.has_sides:
            return None
        integral = self._attachment.compiled.ghost
        assert integral is not None
        columns = list(integral.slots[0].columns) if integral.slots else []
        read = np.concatenate(
            [self._attachment.constants(integral), data["mean"][:, columns].ravel()]
        )
        changed = np.array([self._matrix is None or not np.array_equal(read, self._read)])
        if ranks.any_of(self._attachment.grid.comm, changed)[0]:
            with self._attachment.stopwatch("set-up"):
                self._matrix = self._assembled(integral, data["mean"])
            self._read = read
        return self._matrix

    def _assembled(self, integral: Integral, data: Array) -> sp.csr_matrix:
        attached = self._attachment
        grid, layout = attached.grid, attached.layout
        means = self._means(data)
        columns = list(integral.slots[0].columns) if integral.slots else []
        constants, kernel = attached.constants(integral), _call(integral.kernel)
        vertices = grid.h * np.pad(dolfinx.reference_nodes(1), ((0, 0), (0, 1)))
        shape = (layout.size, layout.size)
        if not attached.sides:
            return sp.csr_matrix(shape)
        here, there = (np.array([side[k] for side in attached.sides]) for k in (0, 1))
        (c0, t0), (c1, t1) = layout.on_cells(here), layout.on_cells(there)
        coefficients, t = np.concatenate([c0, c1], axis=1), np.stack([t0, t1], axis=1)
        count, dofs = len(t0), t0.shape[1]
        packed = np.stack([means[grid.window.numbers(of)][:, columns] for of in (here, there)], 1)
        facets = np.array(
            [[FACETS.index(n) for n in names] for *_, names in attached.sides], dtype=np.int32
        )
        place = here if integral.reads_position else here[:, :0]
        rounded = np.rint(packed.reshape(count, -1) / (SAME * np.abs(packed).max(initial=1e-300)))
        rows = np.column_stack([facets, rounded, place, t.reshape(count, -1)])
        bits = rows.view(np.dtype((np.void, rows.itemsize * rows.shape[1]))).ravel()
        _, first, alike = np.unique(bits, return_index=True, return_inverse=True)
        element = np.zeros((len(first), 2, dofs, 2, dofs))
        for values, k in zip(element, first, strict=True):
            shift = grid.h * np.array([*(there[k] - here[k]), 0])
            x = np.concatenate([vertices, vertices + shift])
            if integral.reads_position:
                x[:, : grid.space.dim] += grid.in_metres(here[k])
            kernel(values, packed[k].ravel(), constants, x.ravel(), facets[k])
        t = t[first]
        blocks = t.transpose(0, 1, 3, 2)[:, :, None] @ element.transpose(0, 1, 3, 2, 4) @ t[:, None]
        entries = blocks.transpose(0, 1, 3, 2, 4)  # sides x (cell, function) x (cell, function)
        entries = entries.reshape(len(first), coefficients.shape[1], -1)
        i, j = np.nonzero(entries.any(axis=0))
        row, column = (coefficients[:, one].ravel() for one in (i, j))
        return sp.csr_matrix((entries[:, i, j][alike].ravel(), (row, column)), shape=shape)

    def _means(self, data: Array) -> Array:
        """Volume-weighted means over the particles of each cell of the window, cells x columns."""
        attached = self._attachment
        columns = np.column_stack([np.ones(len(data)), data])
        sums = _rust.cell_sums(attached.location, attached.volume, columns)
        attached.grid.window.of_cells.update(sums)
        volume = sums[:, :1]
        return np.asarray(sums[:, 1:] / np.where(volume > 0, volume, 1.0))


def _call(kernel: Kernel) -> Callable[..., None]:
    """A kernel of FFCx for two cells, as a function of arrays."""
    function = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 7)(kernel.address)
    permutation = np.zeros(2, dtype=np.uint8)  # both cells run along the side in one direction

    def call(element: Array, packed: Array, constants: Array, x: Array, facets: Any) -> None:
        arrays = (element, packed, constants, x, facets, permutation)
        function(*(array.ctypes.data for array in arrays), None)

    return call
