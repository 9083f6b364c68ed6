"""The dolfinx mesh of a grid and its function spaces.

Forms are compiled once without a mesh, and then attached to a list of cells or facets with coefficient
arrays packed by hand (contract 3 of CONTRIBUTING.md): a change of the active cells needs no compilation.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from tawami.base.arrays import Array, Indices
from tawami.base.space import lattice
from tawami.fem.dolfinx import OLD, IntegralType, cpp, create_mesh, function_space, version
from tawami.fem.kernels import Kernel, quiet, settings

Integers = npt.NDArray[np.int32]


#: Facets of a cell, by the edge of the grid on that side.
FACETS = ("bottom", "left", "right", "top")


class Rectangle:
    """The dolfinx mesh of a grid. Making one is a collective call.

    Args:
        comm: Communicator.
        origin, h, cells: Lower left corner [m], side of a cell [m] and numbers of cells of the grid.
        box: First cell of this rank along each axis, and the cell after its last one.

    Attributes:
        ij: Cell (i, j) of each of this rank's dolfinx cells, cells x 2.
    """

    def __init__(
        self,
        comm: Any,
        origin: Sequence[float],
        h: float,
        cells: Sequence[int],
        box: tuple[Indices, Indices],
    ) -> None:
        index = lattice([np.arange(*ends) for ends in zip(*box, strict=True)])
        corners = lattice([np.arange(2)] * len(cells))  # in the order of dolfinx
        shape = [n + 1 for n in cells]
        share = np.array_split(np.arange(int(np.prod(shape))), comm.size)[comm.rank]
        x = origin + h * np.stack(np.unravel_index(share, shape, order="F"), axis=-1)
        vertices = (index[:, None] + corners) @ np.cumprod((1, *shape[:-1]))
        self.mesh = create_mesh(comm, vertices, x)
        self.cpp = self.mesh._mesh if OLD else self.mesh._cpp_object
        x = np.asarray(self.mesh.geometry.x)[:, : len(cells)]
        at = (x[_table(_vertices(self.mesh.geometry), len(corners))] - origin) / h
        self.ij = np.floor(at.mean(axis=1)).astype(np.int64)
        if not np.allclose(at, self.ij[:, None] + corners, atol=1e-6):
            raise RuntimeError("internal: dolfinx gave cells of different orientation")

    def domain(self, cells: Integers) -> Any:
        """Integration domain of some cells, in ascending order."""
        if not OLD:
            return cells
        values = np.zeros(len(cells), dtype=np.int32)
        return cpp.mesh.MeshTags_int32(self.cpp, self.ij.shape[1], cells, values)


class FunctionSpace:
    """A function space on the mesh of a grid, made when it is first needed, on all ranks at once.

    Assembly at the particles needs none.
    """

    def __init__(self, rectangle: Rectangle, element: Any) -> None:
        self.rectangle, self._element = rectangle, element

    @functools.cached_property
    def _space(self) -> Any:
        compiled = settings(self.rectangle.mesh.comm, self._element) if OLD else None
        with quiet():
            return function_space(self.rectangle.mesh, self._element, compiled)

    @functools.cached_property
    def dofs(self) -> Integers:
        """Degrees of freedom of each of this rank's cells, cells x dofs."""
        dofmap, bs = self._space.dofmap, self._bs
        width = dofmap.dof_layout.num_dofs
        blocks = _table(dofmap.list, width)
        return (bs * blocks[:, :, None] + np.arange(bs)).reshape(-1, bs * width)

    @property
    def own(self) -> int:
        """Number of degrees of freedom that this rank owns; they come first."""
        return int(self._map.size_local) * self._bs

    @property
    def size(self) -> int:
        """Number of degrees of freedom of its cells."""
        return self.own + int(self._map.num_ghosts) * self._bs

    @property
    def _map(self) -> Any:
        return self._space.dofmap.index_map

    @property
    def _bs(self) -> int:
        return int(self._space.dofmap.index_map_bs)

    def form(self, kernel: Kernel, rank: int, entities: Any) -> Any:
        """A form of a rank (1: vector, 2: matrix) with one kernel over some entities."""
        kind, spaces = _key(kernel), [self._space._cpp_object] * rank
        if OLD:
            old = {kind: ([(0, kernel.address)], entities)}
            return cpp.fem.Form_float64(spaces, old, [], [], False, self.rectangle.cpp)
        none = np.empty(0, dtype=np.int8)
        integrals = {kind: [(0, kernel.address, entities, none)]}
        maps: Any = {} if version.startswith("0.9") else []
        return cpp.fem.Form_float64(spaces, integrals, [], [], False, maps, self.rectangle.cpp)

    def create_matrix(self, cells: Integers) -> Any:
        """PETSc matrix with the pattern of the given cells only."""
        maps, bs = [self._map, self._map], [self._bs, self._bs]
        pattern = cpp.la.SparsityPattern(self.rectangle.mesh.comm, maps, bs)
        for dofs in (self.dofs[cells, :: self._bs] // self._bs).astype(np.int32):
            pattern.insert(dofs, dofs)
        pattern.assemble() if OLD else pattern.finalize()
        return cpp.la.petsc.create_matrix(self.rectangle.mesh.comm, pattern)


def add_matrix(matrix: Any, form: Any, kernel: Kernel, constants: Array, packed: Array) -> None:
    """Add to a matrix; `packed` has one row of coefficients per entity of the form."""
    coefficients = {(_key(kernel), 0): packed}
    cpp.fem.petsc.assemble_matrix(matrix, form, constants, coefficients, [])


def add_vector(vector: Array, form: Any, kernel: Kernel, constants: Array, packed: Array) -> None:
    """Add to a vector; `packed` as in :func:`add_matrix`."""
    cpp.fem.assemble_vector(vector, form, constants, {(_key(kernel), 0): packed})


def _key(kernel: Kernel) -> Any:
    return getattr(IntegralType, kernel.kind)


def _table(connectivity: Any, width: int) -> Integers:
    """A table with rows of one width; a rank may have no rows."""
    array = connectivity if isinstance(connectivity, np.ndarray) else connectivity.array
    return np.asarray(array, dtype=np.int32).reshape(-1, width)


def _vertices(geometry: Any) -> Any:
    """Vertices of each cell."""
    return geometry.dofmaps[0] if hasattr(geometry, "dofmaps") else geometry.dofmap
