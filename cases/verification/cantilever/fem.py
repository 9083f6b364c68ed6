"""The cantilever by finite elements, in plain dolfinx (0.5 to 0.11): what the MPM is compared with.

fem_q2            biquadratic displacement, 3 x 3 Gauss points
fem_taylor_hood   biquadratic displacement, bilinear p, 3 x 3 Gauss points; Herrmann's form,
                  sigma = 2 mu eps + p I, div u = p/lambda
fem_q1_bbar       bilinear displacement, volumetric part at the cell's centre

python -m cases.verification.cantilever.fem
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from time import perf_counter
from typing import Any

import dolfinx
import numpy as np
import ufl
from mpi4py import MPI

from cases.common.finite_elements import (
    function_space,
    lagrange,
    mixed_element,
    nodal_value,
    prescribed,
    solution_of,
)  # fmt: skip
from cases.common.table import as_text
from cases.verification.cantilever.beam import (
    COLUMNS,
    LAMBDA,
    MU,
    D,
    K,
    L,
    P,
    Row,
    mean_stress,
    root_displacement_x,
    shear,
)  # fmt: skip

METHODS = ("fem_q2", "fem_taylor_hood", "fem_q1_bbar")


def solve(method: str, support: str, n: int) -> Row:
    """Solve the beam on 2n x n squares."""
    start = perf_counter()
    corners = [np.array([0.0, -D / 2]), np.array([L, D / 2])]
    squares = dolfinx.mesh.CellType.quadrilateral
    mesh = dolfinx.mesh.create_rectangle(MPI.COMM_WORLD, corners, [2 * n, n], squares)
    mixed = method == "fem_taylor_hood"
    degree = 1 if method == "fem_q1_bbar" else 2
    displacement = lagrange(degree, 2)
    elements = mixed_element([displacement, lagrange(1)]) if mixed else displacement
    W = function_space(mesh, elements)
    V = W.sub(0) if mixed else W

    # -- weak form; the unknown of the mixed form is p/mu, which is of the size of a strain
    dx = ufl.dx(domain=mesh, metadata={"quadrature_degree": 2 * degree})
    dx_volume = ufl.dx(domain=mesh, metadata={"quadrature_degree": 1 if degree == 1 else 4})
    trial, test = ufl.TrialFunction(W), ufl.TestFunction(W)
    (u, p), (w, q) = (ufl.split(f) if mixed else (f, None) for f in (trial, test))
    a = 2 * MU * ufl.inner(ufl.sym(ufl.grad(u)), ufl.grad(w)) * dx
    if mixed:
        a += MU * (p * ufl.div(w) + q * ufl.div(u) - MU / LAMBDA * p * q) * dx
    else:
        a += -2 / 3 * MU * ufl.div(u) * ufl.div(w) * dx + K * ufl.div(u) * ufl.div(w) * dx_volume
    x = ufl.SpatialCoordinate(mesh)
    tip, root = at_end(mesh, L, 1), at_end(mesh, 0.0, 2)
    tags = dolfinx.mesh.meshtags(mesh, 1, *(np.concatenate(c) for c in zip(tip, root, strict=True)))
    ds = ufl.ds(domain=mesh, subdomain_data=tags, metadata={"quadrature_degree": 4})
    if support == "exact":
        load = shear(x[1]) * w[1] * ds(2) - shear(x[1]) * w[1] * ds(1)
    else:
        load = -P / D * w[1] * ds(1)

    # -- supports
    on_root: Callable[[Any], Any] = lambda x: np.isclose(x[0], 0.0)  # noqa: E731
    at_centre: Callable[[Any], Any] = lambda x: on_root(x) & np.isclose(x[1], 0.0)  # noqa: E731
    profile = root_displacement_x if support == "exact" else np.zeros_like
    supports = [
        prescribed(V, 0, on_root, lambda x: profile(x[1])),
        prescribed(V, 1, on_root if support == "clamped" else at_centre, lambda x: 0 * x[0]),
    ]

    solution = solution_of(a, load, supports)

    # -- results
    at_tip: Callable[[Any], Any] = lambda x: np.isclose(x[0], L) & np.isclose(x[1], 0.0)  # noqa: E731
    deflection = -nodal_value(W, V, 1, solution, at_tip)
    error = None
    if support == "exact":
        uh, ph = ufl.split(solution) if mixed else (solution, None)
        sigma_m = MU * (ph + 2 / 3 * ufl.div(uh)) if mixed else K * ufl.div(uh)
        exact = mean_stress(x[0], x[1])
        error = float(np.sqrt(
            integral((sigma_m - exact) ** 2 * dx_volume) / integral(exact**2 * dx_volume)
        ))  # fmt: skip
    held = sum(bc.dof_indices()[1] for bc in supports)
    size = W.dofmap.index_map.size_global * W.dofmap.index_map_bs
    return Row(
        method=method,
        support=support,
        n=n,
        alpha=None,
        particles_per_cell=None,
        deflection_m=deflection,
        mean_stress_l2=error,
        newton_iterations=1,
        unknowns=size - mesh.comm.allreduce(held),
        wall_s=perf_counter() - start,
    )


def at_end(mesh: Any, x: float, tag: int) -> tuple[Any, Any]:
    """Facets at one end of the beam, ascending, and their tags."""
    facets = dolfinx.mesh.locate_entities_boundary(mesh, 1, lambda y: np.isclose(y[0], x))
    return np.sort(facets), np.full(len(facets), tag, dtype=np.int32)


def integral(form: Any) -> float:
    """Value of a form without arguments, over all ranks."""
    value = dolfinx.fem.assemble_scalar(dolfinx.fem.form(form))
    return float(MPI.COMM_WORLD.allreduce(value))


if __name__ == "__main__":
    logging.disable(logging.INFO)  # the compilation of forms is talkative
    for kind in ("paper", "exact", "clamped"):
        rows = [solve(m, kind, n) for m in METHODS for n in (2, 4, 8, 16)]
        if MPI.COMM_WORLD.rank == 0:
            print(as_text(rows, COLUMNS))
