"""The cantilever by finite elements in plain dolfinx (0.5 to 0.11), to compare the MPM with.

fem_q2            biquadratic displacement, 3 x 3 Gauss points
fem_taylor_hood   biquadratic displacement, bilinear p, 3 x 3 Gauss points; Herrmann's form,
                  sigma = 2 mu eps + p I, div u = p/lambda
fem_q1_bbar       bilinear displacement, volumetric part at the cell's centre

python -m cases.verification.cantilever.fem
"""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter
from typing import Any

import dolfinx
import numpy as np
import ufl
from mpi4py import MPI

from cases.common.finite_elements import (
    free_unknowns,
    function_space,
    integral,
    lagrange,
    mixed_element,
    nodal_value,
    prescribed,
    run,
    solution_of,
)
from cases.common.table import as_text
from cases.verification.cantilever.beam import (
    COLUMNS,
    LAMBDA,
    MU,
    SUPPORTS,
    D,
    K,
    L,
    P,
    Row,
    mean_stress,
    root_displacement_x,
    shear,
)

METHODS = ("fem_q2", "fem_taylor_hood", "fem_q1_bbar")
TIP, ROOT = 1, 2  # tags of the two ends


def solve(method: str, support: str, n: int) -> Row:
    """Solve the beam on 2n x n squares."""
    start = perf_counter()
    corners = [np.array([0.0, -D / 2]), np.array([L, D / 2])]
    squares = dolfinx.mesh.CellType.quadrilateral
    mesh = dolfinx.mesh.create_rectangle(MPI.COMM_WORLD, corners, [2 * n, n], squares)
    mixed = method == "fem_taylor_hood"
    degree = 1 if method == "fem_q1_bbar" else 2
    displacement = lagrange(degree, 2)
    W = function_space(mesh, mixed_element([displacement, lagrange(1)]) if mixed else displacement)
    V = W.sub(0) if mixed else W

    # weak form; the unknown p of the mixed form is divided by mu, so that it is of the size of a strain
    dx = ufl.dx(domain=mesh, metadata={"quadrature_degree": 2 * degree})
    dx_volume = ufl.dx(domain=mesh, metadata={"quadrature_degree": 1 if degree == 1 else 4})
    trial, test = ufl.TrialFunction(W), ufl.TestFunction(W)
    (u, p), (w, q) = (ufl.split(f) if mixed else (f, None) for f in (trial, test))
    a = 2 * MU * ufl.inner(ufl.sym(ufl.grad(u)), ufl.grad(w)) * dx
    if mixed:
        a += MU * (p * ufl.div(w) + q * ufl.div(u) - MU / LAMBDA * p * q) * dx
    else:
        a += -2 / 3 * MU * ufl.div(u) * ufl.div(w) * dx + K * ufl.div(u) * ufl.div(w) * dx_volume

    supports = supports_of(V, support)
    solution = solution_of(a, load_of(mesh, w, support), supports)
    at_tip: Callable[[Any], Any] = lambda x: np.isclose(x[0], L) & np.isclose(x[1], 0.0)  # noqa: E731
    uh, ph = ufl.split(solution) if mixed else (solution, None)
    sigma_m = MU * (ph + 2 / 3 * ufl.div(uh)) if mixed else K * ufl.div(uh)
    return Row(
        method=method,
        support=support,
        n=n,
        alpha=None,
        particles_per_cell=None,
        deflection_m=-nodal_value(W, V, 1, solution, at_tip),
        mean_stress_l2=mean_stress_error(mesh, sigma_m, dx_volume) if support == "exact" else None,
        newton_iterations=1,
        unknowns=free_unknowns(W, supports),
        wall_s=perf_counter() - start,
    )


def load_of(mesh: Any, w: Any, support: str) -> Any:
    """Work of the tractions on a test function w."""
    y = ufl.SpatialCoordinate(mesh)[1]
    ends = facets(mesh, L, TIP), facets(mesh, 0.0, ROOT)
    tags = dolfinx.mesh.meshtags(mesh, 1, *(np.concatenate(c) for c in zip(*ends, strict=True)))
    ds = ufl.ds(domain=mesh, subdomain_data=tags, metadata={"quadrature_degree": 4})
    if support == "exact":
        return shear(y) * w[1] * ds(ROOT) - shear(y) * w[1] * ds(TIP)
    return -P / D * w[1] * ds(TIP)


def facets(mesh: Any, x: float, tag: int) -> tuple[Any, Any]:
    """Facets at one end of the beam in ascending order, and their tags."""
    found = dolfinx.mesh.locate_entities_boundary(mesh, 1, lambda y: np.isclose(y[0], x))
    return np.sort(found), np.full(len(found), tag, dtype=np.int32)


def supports_of(V: Any, support: str) -> list[Any]:
    """Displacements prescribed on the root."""
    on_root: Callable[[Any], Any] = lambda x: np.isclose(x[0], 0.0)  # noqa: E731
    at_centre: Callable[[Any], Any] = lambda x: on_root(x) & np.isclose(x[1], 0.0)  # noqa: E731
    profile = root_displacement_x if support == "exact" else np.zeros_like
    return [
        prescribed(V, 0, on_root, lambda x: profile(x[1])),
        prescribed(V, 1, on_root if support == "clamped" else at_centre, lambda x: 0 * x[0]),
    ]


def mean_stress_error(mesh: Any, sigma_m: Any, dx: Any) -> float:
    """Relative L2 error of the mean stress."""
    exact = mean_stress(*ufl.SpatialCoordinate(mesh))
    squared = integral((sigma_m - exact) ** 2 * dx) / integral(exact**2 * dx)
    return float(np.sqrt(squared))


def tables() -> str:
    """Deflections with each support, a table each."""
    cells = (2, 4, 8, 16)
    return "\n".join(
        as_text([solve(method, support, n) for method in METHODS for n in cells], COLUMNS)
        for support in SUPPORTS
    )


if __name__ == "__main__":
    run(tables)
