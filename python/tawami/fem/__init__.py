"""Elements, quadrature rules, compiled kernels, and the mesh of a grid: the only importer of dolfinx."""

from tawami.fem.kernels import Kernel
from tawami.fem.mesh import FunctionSpace, Rectangle
from tawami.fem.rules import Rule

__all__ = ["FunctionSpace", "Kernel", "Rectangle", "Rule"]
