"""The imports of dolfinx, basix and FFCx and the elements: versions 0.5.2, 0.9 and 0.11.

The modules of this room take `basix`, `cpp`, `dolfinx`, `ffcx`, `jit` and `ufl` from here, after the
checks that report missing packages. Nothing outside this room imports them.
"""

from __future__ import annotations

import functools
import logging
import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np

from tawami.base.arrays import Array, Indices
from tawami.base.dependencies import report_missing
from tawami.base.space import PLANE

__all__ = [
    "OLD", "IntegralType", "at_points", "at_vertices", "basix", "cpp", "create_mesh", "dolfinx",
    "domain", "element_of", "ffcx", "function_space", "interval", "jit", "lagrange",
    "mixed", "on_interval", "per_cell", "reference_nodes", "version",
]  # fmt: skip

_showwarning = warnings.showwarning

try:
    import basix
    import dolfinx
    import ffcx
    import ufl
    from dolfinx import cpp, jit
except ImportError as error:  # pragma: no cover - exercised in a subprocess by the tests
    report_missing(error)

if warnings.showwarning is not _showwarning:
    # FFCx from 0.9 on sends all warnings of the process to a log, ours included
    logging.captureWarnings(False)

version: str = dolfinx.__version__
#: Whether this is dolfinx 0.5, whose elements are those of UFL.
OLD = not hasattr(dolfinx.fem, "functionspace")
CELL = "quadrilateral"

if OLD:
    from ffcx.codegeneration.C.cnodes import LiteralFloat

    #: FFCx 0.5 asks a factor that cancels to exactly 0 for its operands, which a number lacks.
    LiteralFloat.args = ()
    IntegralType = cpp.fem.IntegralType

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

    def on_interval(components: int) -> Any:
        """Element of constant vectors on an interval."""
        return ufl.VectorElement("DG", "interval", 0, dim=components)

    @functools.cache
    def interval() -> Any:
        """A UFL mesh of intervals, to write forms of one point on."""
        return ufl.Mesh(ufl.VectorElement("Lagrange", "interval", 1, dim=1))

    def function_space(mesh: Any, element: Any, compiled: Any) -> Any:
        """Function space on a dolfinx mesh; this version compiles the element, with these settings."""
        return dolfinx.fem.FunctionSpace(mesh, element, jit_params=compiled)

else:
    import basix.ufl

    IntegralType = dolfinx.fem.IntegralType

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

    def on_interval(components: int) -> Any:
        """Element of constant vectors on an interval."""
        return basix.ufl.element("DG", "interval", 0, shape=(components,))

    @functools.cache
    def interval() -> Any:
        """A UFL mesh of intervals, to write forms of one point on."""
        return ufl.Mesh(basix.ufl.element("Lagrange", "interval", 1, shape=(1,)))

    def function_space(mesh: Any, element: Any, compiled: Any) -> Any:
        """Function space on a dolfinx mesh."""
        return dolfinx.fem.functionspace(mesh, element)


def element_of(fields: Sequence[tuple[int, int]]) -> Any:
    """Element of one or several fields, each with its degree and its number of components."""
    elements = [lagrange(degree, components) for degree, components in fields]
    return elements[0] if len(elements) == 1 else mixed(elements)


def domain() -> Any:
    """A UFL mesh of squares, to write forms on without a grid."""
    return ufl.Mesh(lagrange(1, PLANE.dim))


def create_mesh(comm: Any, vertices: Indices, x: Array) -> Any:
    """A dolfinx mesh of squares without ghosts, whose cells stay on their ranks; a collective call.

    Args:
        comm: Communicator.
        vertices: Numbers of the vertices of each cell of this rank, cells x 4, in the order of dolfinx.
        x: Positions [m] of this rank's share of the vertices: the first rank has the first ones.
    """

    def stay(*_: Any) -> Any:
        ends = np.arange(len(vertices) + 1, dtype=np.int32)
        return cpp.graph.AdjacencyList_int32(np.full(len(vertices), comm.rank, np.int32), ends)

    if OLD:
        none = dolfinx.mesh.GhostMode.none
        return dolfinx.mesh.create_mesh(comm, vertices, x, domain(), none, stay)
    # by name: their order differs between 0.9 and 0.11
    return dolfinx.mesh.create_mesh(comm, cells=vertices, x=x, e=domain(), partitioner=stay)


@functools.cache
def reference_nodes(degree: int) -> Array:
    """Nodes of the scalar Lagrange element in its own order, nodes x 2, in reference axes."""
    element = basix.create_element(
        basix.ElementFamily.P,
        basix.CellType.quadrilateral,
        degree,
        basix.LagrangeVariant.gll_warped,
    )
    return np.asarray(element.points, dtype=np.float64)
