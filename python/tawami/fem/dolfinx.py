"""The only importer of dolfinx and basix: versions 0.5.2, 0.9 and 0.11 end here.

Contract 3 of CONTRIBUTING.md: forms are compiled once, without a mesh, and then attached to a list of
cells (or of facets) with coefficient arrays packed by hand, so that a change of the active cells
costs no compilation.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import logging
import platform
import sys
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from tawami.base.errors import MissingDependencyError
from tawami.fem.rules import DEGREE, Rule

if "petsc4py" not in sys.modules:
    # PETSc would answer a closed pipe (| head) with a page about a crash and abort MPI
    with contextlib.suppress(ImportError):
        import petsc4py

        petsc4py.init(["tawami", "-no_signal_handler"])

_shows = warnings.showwarning

try:
    import basix
    import dolfinx
    import ufl
    from dolfinx import cpp, jit
    from mpi4py import MPI
    from petsc4py import PETSc
except ImportError as error:  # pragma: no cover - exercised in a subprocess by the tests
    raise MissingDependencyError(
        f"tawami needs dolfinx with real PETSc, and importing it failed: {error}. On Debian or "
        "Ubuntu: apt install python3-dolfinx-real python3-petsc4py-real python3-mpi4py, and run "
        "Python from a virtual environment made by /usr/bin/python3 -m venv --system-site-packages"
    ) from error

if warnings.showwarning is not _shows:
    # FFCx from 0.9 on sends all warnings of the process, ours too, to a log that nobody reads
    logging.captureWarnings(False)

if np.dtype(PETSc.ScalarType) != np.float64:
    raise MissingDependencyError(
        f"tawami needs PETSc with real numbers, but its scalars are {np.dtype(PETSc.ScalarType)}. "
        "On Debian: apt install python3-dolfinx-real python3-petsc4py-real, and unset PETSC_DIR"
    )

if np.dtype(PETSc.IntType) != np.int32:
    raise MissingDependencyError(
        f"tawami needs PETSc with 32-bit indices, but its are {np.dtype(PETSc.IntType)}. On Debian: "
        "apt install python3-dolfinx-real python3-petsc4py-real, and unset PETSC_DIR"
    )

version: str = dolfinx.__version__
#: Degrees of freedom of a cell: of the biquadratic displacement (9 nodes), of a bilinear field.
DISPLACEMENT_DOFS, BILINEAR_DOFS = 18, 4
#: Before basix.ufl (dolfinx 0.5) the elements were UFL's own.
OLD = not hasattr(dolfinx.fem, "functionspace")
CELL = "quadrilateral"
Array = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int32]

if OLD:
    _integral = cpp.fem.IntegralType

    def lagrange(degree: int, components: int = 1) -> Any:
        """Lagrange element on squares; a vector element for two components."""
        if components > 1:
            return ufl.VectorElement("Lagrange", CELL, degree, dim=components)
        return ufl.FiniteElement("Lagrange", CELL, degree)

    def mixed(elements: Sequence[Any]) -> Any:
        """Mixed element."""
        return ufl.MixedElement(*elements)

    def at_points(degree: int, components: int) -> Any:
        """Element of vectors given at the points of the quadrature rule of a degree."""
        return ufl.VectorElement("Quadrature", CELL, degree, dim=components, quad_scheme="default")

    def per_cell(components: int) -> Any:
        """Element of vectors constant in each cell."""
        return ufl.VectorElement("DG", CELL, 0, dim=components)

    def at_vertices(components: int) -> Any:
        """Element of vectors given at the vertices."""
        return ufl.VectorElement("Lagrange", CELL, 1, dim=components)

    def _space(mesh: Any, element: Any) -> Any:
        return dolfinx.fem.FunctionSpace(mesh, element)

else:
    import basix.ufl

    _integral = dolfinx.fem.IntegralType

    def lagrange(degree: int, components: int = 1) -> Any:
        """Lagrange element on squares; a vector element for two components."""
        shape = (components,) if components > 1 else None
        return basix.ufl.element("Lagrange", CELL, degree, shape=shape)

    def mixed(elements: Sequence[Any]) -> Any:
        """Mixed element."""
        return basix.ufl.mixed_element(list(elements))

    def at_points(degree: int, components: int) -> Any:
        """Element of vectors given at the points of the quadrature rule of a degree."""
        return basix.ufl.quadrature_element(
            CELL, value_shape=(components,), scheme="default", degree=degree
        )

    def per_cell(components: int) -> Any:
        """Element of vectors constant in each cell."""
        return basix.ufl.element("DG", CELL, 0, shape=(components,))

    def at_vertices(components: int) -> Any:
        """Element of vectors given at the vertices."""
        return basix.ufl.element("Lagrange", CELL, 1, shape=(components,))

    def _space(mesh: Any, element: Any) -> Any:
        return dolfinx.fem.functionspace(mesh, element)


def domain() -> Any:
    """A UFL mesh of squares to write forms on before there is a grid."""
    return ufl.Mesh(lagrange(1, 2))


@functools.cache
def reference_points(degree: int) -> Array:
    """Points of the quadrature rule of a degree: points x 2, in reference axes."""
    points = basix.make_quadrature(basix.CellType.quadrilateral, degree)[0]
    return np.asarray(points, dtype=np.float64)


def triangle_rule(degree: int) -> tuple[Array, Array]:
    """Points and weights on the triangle (0, 0), (1, 0), (0, 1), all inside and positive."""
    points, weights = basix.make_quadrature(basix.CellType.triangle, degree)
    return np.asarray(points, dtype=np.float64), np.asarray(weights, dtype=np.float64)


def rule_points(rule: Rule) -> Array:
    """Points of a rule of densities; none for means over cells."""
    if rule == "mean":
        return np.empty((0, 2))
    return reference_nodes(1) if rule == "vertex" else reference_points(DEGREE[rule])


@functools.cache
def reference_nodes(degree: int) -> Array:
    """Nodes of the scalar Lagrange element, in its order: nodes x 2, in reference axes."""
    element = basix.create_element(
        basix.ElementFamily.P,
        basix.CellType.quadrilateral,
        degree,
        basix.LagrangeVariant.gll_warped,
    )
    return np.asarray(element.points, dtype=np.float64)


def _table(connectivity: Any, width: int) -> Integers:
    """Rows of the same width; a rank may have none."""
    array = connectivity if isinstance(connectivity, np.ndarray) else connectivity.array
    return np.asarray(array, dtype=np.int32).reshape(-1, width)


def _vertices(geometry: Any) -> Any:
    """Vertices of each cell."""
    return geometry.dofmaps[0] if hasattr(geometry, "dofmaps") else geometry.dofmap


# -- kernels -----------------------------------------------------------------


@functools.cache
def cache_directory() -> Path:
    """Kernels are compiled for this processor, so they are kept apart from those of others."""
    try:
        flags = next(s for s in Path("/proc/cpuinfo").read_text().splitlines() if "flags" in s)
    except (OSError, StopIteration):
        flags = platform.processor()
    default = jit.get_options()["cache_dir"] if not OLD else jit.get_parameters()["cache_dir"]
    return Path(default) / f"tawami-{hashlib.sha1(flags.encode()).hexdigest()[:10]}"


@contextmanager
def _quiet() -> Iterator[None]:
    """The build of a kernel tells its whole story at level INFO of the root logger."""
    before = logging.root.manager.disable
    logging.disable(logging.INFO)
    try:
        yield
    finally:
        logging.disable(before)


#: What integrals go over, in the order of FFCx.
Kind = Literal["cell", "exterior_facet", "interior_facet"]
KINDS: tuple[Kind, ...] = ("cell", "exterior_facet", "interior_facet")


@dataclass(frozen=True)
class Kernel:
    """A compiled integral over cells or facets, not yet attached to a mesh.

    Attributes:
        kind: What it integrates over.
        address: Address of the C function.
        coefficients: Positions, in the form's coefficients, of those it reads, in packed order.
        module: Keeps the C function loaded.
    """

    kind: Kind
    address: int
    coefficients: tuple[int, ...]
    module: Any


#: Sums may be reordered, so that they vectorise: a fifth less time. Not -ffast-math: the linker would
#: then switch off denormal numbers in the whole process.
COMPILER_FLAGS = (
    "-O3", "-march=native", "-g0", "-w", "-fno-math-errno", "-fno-trapping-math",
    "-fassociative-math", "-fno-signed-zeros", "-freciprocal-math",
)  # fmt: skip


def compile_kernel(comm: Any, form: Any, kind: Kind = "cell") -> Kernel:
    """Compile a UFL form with one kind of integral; the result is cached on disk."""
    settings = {"cffi_extra_compile_args": list(COMPILER_FLAGS), "cache_dir": cache_directory()}
    with _quiet():
        compiled, module, _ = jit.ffcx_jit(comm, form, {}, settings)
    place = KINDS.index(kind)
    if OLD:
        integral = compiled.integrals(place)[0]
        order = compiled.original_coefficient_position
    else:
        integral = compiled.form_integrals[compiled.form_integral_offsets[place]]
        order = compiled.original_coefficient_positions
    address = int(module.ffi.cast("uintptr_t", integral.tabulate_tensor_float64))
    used = tuple(order[i] for i in range(compiled.num_coefficients))
    return Kernel(kind, address, used, module)


# -- mesh and spaces ---------------------------------------------------------


class Rectangle:
    """The dolfinx mesh of a grid, with its cells known by (i, j).

    Attributes:
        ij: Cell (i, j) of each of this rank's dolfinx cells, cells x 2.
        swapped: Whether reference axis 0 is y (it is, in create_rectangle).
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

    def facet_order(self, cells: Integers, local: int) -> Integers:
        """Order in which the facets `local` of `cells` are assembled."""
        if not OLD:
            return np.arange(len(cells), dtype=np.int32)
        return np.argsort(self._facets(cells, local)).astype(np.int32)

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


class Space:
    """A function space on the mesh of a grid.

    Attributes:
        dofs: Degrees of freedom of each of this rank's cells, cells x dofs.
        own: Number of degrees of freedom that this rank owns; they come first.
        size: Number of degrees of freedom of its cells.
    """

    def __init__(self, rectangle: Rectangle, element: Any) -> None:
        self.rectangle = rectangle
        with _quiet():
            self._space = _space(rectangle.mesh, element)
        dofmap = self._space.dofmap
        bs = dofmap.index_map_bs
        width = dofmap.dof_layout.num_dofs
        blocks = _table(dofmap.list, width)
        self.dofs = (bs * blocks[:, :, None] + np.arange(bs)).reshape(-1, bs * width)
        self.own = int(dofmap.index_map.size_local) * bs
        self.size = self.own + int(dofmap.index_map.num_ghosts) * bs
        self._map, self._bs = dofmap.index_map, bs

    def form(self, kernel: Kernel, rank: int, entities: Any) -> Any:
        """A form of the given rank with one kernel over the given entities."""
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
    return getattr(_integral, kernel.kind)
