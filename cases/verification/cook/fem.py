"""Cook's membrane by finite elements in plain dolfinx (0.5 to 0.11): the reference of the MPM.

fem_q2            biquadratic displacement
fem_taylor_hood   biquadratic displacement, bilinear p; Herrmann's form,
                  sigma = 2 mu eps + p I, div u = p/lambda
fem_graded        Taylor-Hood on a mesh that is finer towards the corners of the clamped side, where
                  the stress is singular: the reference

n x n quadrilaterals follow the slanted sides.

python -m cases.verification.cook.fem
"""

from __future__ import annotations

import dolfinx
import numpy as np
import ufl
from mpi4py import MPI

from cases.common.finite_elements import (
    free_unknowns,
    function_space,
    lagrange,
    mixed_element,
    nodal_value,
    prescribed,
    run,
    solution_of,
)
from cases.common.table import as_text
from cases.verification.cook.membrane import (
    COLUMNS,
    CORNERS,
    LENGTH,
    MIDDLE,
    REFERENCE,
    SHEAR,
    E,
    Row,
)

METHODS = ("fem_q2", "fem_taylor_hood", "fem_graded")


def mesh_of(n: int, graded: bool) -> dolfinx.mesh.Mesh:
    """n x n quadrilaterals: the unit square mapped bilinearly onto the trapezoid."""
    squares = dolfinx.mesh.CellType.quadrilateral
    mesh = dolfinx.mesh.create_unit_square(MPI.COMM_WORLD, n, n, squares)
    s, t = mesh.geometry.x[:, 0].copy(), mesh.geometry.x[:, 1].copy()
    if graded:  # cell sizes grow linearly with the distance from s = 0, and from t = 0 and 1
        s, t = s**2, np.where(t < 0.5, 2 * t**2, 1 - 2 * (1 - t) ** 2)
    (_, root), (_, low), (_, high), (_, top) = CORNERS
    mesh.geometry.x[:, 0] = LENGTH * s
    mesh.geometry.x[:, 1] = (1 - t) * (root + (low - root) * s) + t * (top + (high - top) * s)
    return mesh


def solve(method: str, nu: float, n: int) -> Row:
    """Solve the membrane on n x n quadrilaterals."""
    mesh = mesh_of(n, method == "fem_graded")
    mixed = method != "fem_q2"
    displacement = lagrange(2, 2)
    W = function_space(mesh, mixed_element([displacement, lagrange(1)]) if mixed else displacement)
    V = W.sub(0) if mixed else W

    # weak form; the unknown p of the mixed form is divided by mu, so that it is of the size of a strain
    mu, lam = E / (2 * (1 + nu)), E * nu / ((1 + nu) * (1 - 2 * nu))
    dx = ufl.dx(domain=mesh, metadata={"quadrature_degree": 6})
    trial, test = ufl.TrialFunction(W), ufl.TestFunction(W)
    (u, p), (w, q) = (ufl.split(f) if mixed else (f, None) for f in (trial, test))
    a = 2 * mu * ufl.inner(ufl.sym(ufl.grad(u)), ufl.grad(w)) * dx
    if mixed:
        a += mu * (p * ufl.div(w) + q * ufl.div(u) - mu / lam * p * q) * dx
    else:
        a += lam * ufl.div(u) * ufl.div(w) * dx
    end = dolfinx.mesh.locate_entities_boundary(mesh, 1, lambda x: np.isclose(x[0], LENGTH))
    tags = dolfinx.mesh.meshtags(mesh, 1, np.sort(end), np.ones(len(end), dtype=np.int32))
    load = SHEAR * w[1] * ufl.ds(domain=mesh, subdomain_data=tags)(1)

    supports = [
        prescribed(V, component, lambda x: np.isclose(x[0], 0.0), lambda x: 0 * x[0])
        for component in (0, 1)
    ]
    solution = solution_of(a, load, supports)
    at_middle = lambda x: np.isclose(x[0], MIDDLE[0]) & np.isclose(x[1], MIDDLE[1])  # noqa: E731
    return Row(
        method=method,
        body=None,
        nu=nu,
        h=LENGTH / n,
        deflection=nodal_value(W, V, 1, solution, at_middle),
        particles=None,
        unknowns=free_unknowns(W, supports),
        condition=None,
    )


def table() -> str:
    """Deflections on finer and finer meshes."""
    cells = (12, 24, 48, 96, 192)
    rows = [solve(method, nu, n) for nu in REFERENCE for method in METHODS for n in cells]
    return as_text(rows, COLUMNS)


if __name__ == "__main__":
    run(table)
