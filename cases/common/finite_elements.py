"""Lagrange elements on quadrilaterals in plain dolfinx (0.5 to 0.11), for cases that compare the MPM
with finite elements. Nothing of tawami.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from typing import Any

import dolfinx.fem.petsc
import ufl

try:
    from basix.ufl import element, mixed_element

    function_space = dolfinx.fem.functionspace

    def lagrange(degree: int, *shape: int) -> Any:
        """Lagrange element on quadrilaterals."""
        return element("Lagrange", "quadrilateral", degree, shape=shape)
except ImportError:  # dolfinx 0.5
    function_space = dolfinx.fem.FunctionSpace

    def lagrange(degree: int, *shape: int) -> Any:
        """Lagrange element on quadrilaterals."""
        kind = ufl.VectorElement if shape else ufl.FiniteElement
        return kind("Lagrange", "quadrilateral", degree)

    def mixed_element(elements: list[Any]) -> Any:
        """Mixed element."""
        return ufl.MixedElement(*elements)


def prescribed(V: Any, component: int, where: Callable[[Any], Any], value: Any) -> Any:
    """A displacement component prescribed at the nodes of a region."""
    Vi, _ = V.sub(component).collapse()
    function = dolfinx.fem.Function(Vi)
    function.interpolate(value)
    dofs = dolfinx.fem.locate_dofs_geometrical((V.sub(component), Vi), where)
    return dolfinx.fem.dirichletbc(function, dofs, V.sub(component))


def solution_of(a: Any, load: Any, supports: Sequence[Any]) -> Any:
    """Function with a(solution, test) = load(test), by MUMPS."""
    options = {"ksp_type": "preonly", "pc_type": "lu", "pc_factor_mat_solver_type": "mumps"}
    problem_class = dolfinx.fem.petsc.LinearProblem
    prefix = "petsc_options_prefix" in inspect.signature(problem_class).parameters
    extra = {"petsc_options_prefix": "finite_elements_"} if prefix else {}
    problem = problem_class(a, load, bcs=list(supports), petsc_options=options, **extra)
    solution = problem.solve()
    assert isinstance(solution, dolfinx.fem.Function)
    return solution


def nodal_value(
    W: Any, V: Any, component: int, solution: Any, where: Callable[[Any], Any]
) -> float:
    """Displacement component at the one node of a region, on every rank; V is W or its part."""
    Vi, _ = V.sub(component).collapse()
    dofs = dolfinx.fem.locate_dofs_geometrical((V.sub(component), Vi), where)[0]
    own = W.dofmap.index_map.size_local * W.dofmap.index_map_bs
    value = sum(float(solution.x.array[dof]) for dof in dofs if dof < own)
    return float(W.mesh.comm.allreduce(value))
