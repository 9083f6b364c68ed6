"""One nonlinear step as algebra: Newton's method, measures, scaling, linear solvers, diagnosis."""

from tawami.solve.inertia import Inertia
from tawami.solve.newton import Converged, Newton
from tawami.solve.numerics import Numerics

__all__ = ["Converged", "Inertia", "Newton", "Numerics"]
