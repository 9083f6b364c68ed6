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
from mpi4py import MPI

from tawami.base.arrays import Array
from tawami.fem.dolfinx import OLD, IntegralType, cpp, dolfinx, function_space, version
from tawami.fem.kernels import Kernel, quiet, settings

Integers = npt.NDArray[np.int32]


class Rectangle:
    """The dolfinx mesh of a grid.

    Attributes:
        ij: Cell (i, j) of each of this rank's dolfinx cells, cells x 2.
        swapped: Whether reference axis 0 is y, as in meshes of create_rectangle.
    """

    def __init__(self, comm: Any, origin: Sequence[float], h: float, cells: Sequence[int]) -> None:
        corners = [np.array(origin), np.array(origin) + h * np.array(cells)]
        none = dolfinx.mesh.GhostMode.none
        kind = dolfinx.mesh.CellType.quadrilateral
        self.mesh = dolfinx.mesh.create_rectangle(comm, corners, cells, kind, ghost_mode=none)
        self.cpp = self.mesh._mesh if OLD else self.mesh._cpp_object
        x = np.asarray(self.mesh.geometry.x)[:, :2]
        # the vertices of each cell in reference order (0, 0), (1, 0), (0, 1), (1, 1): axis 0 first
        vertices = x[_table(_vertices(self.mesh.geometry), 4)]
        axis0 = (vertices[:, 1] - vertices[:, 0]) / h
        # a rank may be without cells
        self.swapped = comm.allreduce(bool((np.abs(axis0[:, 1]) > 0.5).any()), op=MPI.LOR)
        expected = np.array([0.0, 1.0]) if self.swapped else np.array([1.0, 0.0])
        if not np.allclose(axis0, expected, atol=1e-6):
            raise RuntimeError("internal: dolfinx gave cells of different orientation")
        middle = (vertices.mean(axis=1) - corners[0]) / h
        self.ij = np.floor(middle).astype(np.int64)

    def to_grid_axes(self, points: Array) -> Array:
        """Reference positions (dolfinx axes) as positions in the cell along x and y."""
        return points[:, ::-1] if self.swapped else points

    def facet_of_edge(self, edge: str) -> int:
        """Local number of a cell's facet on its 'left', 'right', 'bottom' or 'top' side."""
        # reference facets: axis 1 = 0, axis 0 = 0, axis 0 = 1, axis 1 = 1
        names = ("left", "bottom", "top", "right") if self.swapped else (
            "bottom", "left", "right", "top")  # fmt: skip
        return names.index(edge)

    def _facets(self, cells: Integers, local: int) -> Integers:
        topology = self.mesh.topology
        topology.create_connectivity(2, 1)
        topology.create_connectivity(1, 2)
        facets: Integers = _table(topology.connectivity(2, 1), 4)[cells, local]
        return facets

    def entities(self, cells: Integers, local: int | None) -> Any:
        """Integration domain: cells, or facets `local` of cells (both in assembly order)."""
        if OLD:
            ids = cells if local is None else self._facets(cells, local)
            values = np.zeros(len(ids), dtype=np.int32)
            return cpp.mesh.MeshTags_int32(self.cpp, 2 if local is None else 1, ids, values)
        if local is None:
            return cells
        return np.column_stack([cells, np.full(len(cells), local)]).astype(np.int32).ravel()


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
