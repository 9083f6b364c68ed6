"""Lagrange elements on quadrilaterals in plain dolfinx (0.5 to 0.11), for cases that compare the MPM
with finite elements. Imports nothing of tawami.
"""

from __future__ import annotations

import inspect
import logging
from collections.abc import Callable, Sequence
from typing import Any

import dolfinx.fem.petsc
import ufl
from mpi4py import MPI

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
    """Boundary condition: a displacement component prescribed at the nodes of a region."""
    Vi, _ = V.sub(component).collapse()
    function = dolfinx.fem.Function(Vi)
    function.interpolate(value)
    dofs = dolfinx.fem.locate_dofs_geometrical((V.sub(component), Vi), where)
    return dolfinx.fem.dirichletbc(function, dofs, V.sub(component))


def solution_of(a: Any, load: Any, supports: Sequence[Any]) -> Any:
    """Solve a(u, test) = load(test) for the function u, by MUMPS."""
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
    """Displacement component at the only node of a region, on every rank.

    Args:
        W: Space of the solution.
        V: W itself, or its subspace of displacements.
        component: 0 or 1.
        solution: Function in W.
        where: Region, a function of coordinates 3 x points.
    """
    Vi, _ = V.sub(component).collapse()
    dofs = dolfinx.fem.locate_dofs_geometrical((V.sub(component), Vi), where)[0]
    own = W.dofmap.index_map.size_local * W.dofmap.index_map_bs
    value = sum(float(solution.x.array[dof]) for dof in dofs if dof < own)
    return float(W.mesh.comm.allreduce(value))


def free_unknowns(W: Any, supports: Sequence[Any]) -> int:
    """Number of unknowns of a space that no support prescribes, over all ranks."""
    size = W.dofmap.index_map.size_global * W.dofmap.index_map_bs
    held = sum(support.dof_indices()[1] for support in supports)
    return int(size - W.mesh.comm.allreduce(held))


def integral(form: Any) -> float:
    """Value of a form without arguments, over all ranks."""
    value = dolfinx.fem.assemble_scalar(dolfinx.fem.form(form))
    return float(MPI.COMM_WORLD.allreduce(value))


def run(main: Callable[[], str]) -> None:
    """Run a program of finite elements and print its text on the first rank."""
    logging.disable(logging.INFO)  # compiling a form logs many lines
    text = main()
    if MPI.COMM_WORLD.rank == 0:
        print(text)
