"""The vibrating beam by finite elements in plain dolfinx (0.5 to 0.11), to compare the MPM with.

Biquadratic displacement, small strain, consistent mass, 3 x 3 Gauss points: K u = omega^2 M u.

python -m cases.verification.vibrating_beam.fem
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import dolfinx.fem.petsc
import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
import ufl
from mpi4py import MPI
from scipy.sparse.linalg import eigsh

from cases.common.finite_elements import function_space, lagrange, run
from cases.verification.vibrating_beam.beam import NUS, RHO, D, L, first_bending, lame, mode

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Modes:
    """The lowest modes.

    Attributes:
        omega: Angular frequencies [rad/s], ascending.
        share: Share of each mode in the kinetic energy of a beam that starts with Timoshenko's first
            mode.
    """

    omega: Array
    share: Array


def solve(nu: float, n: int = 8, number: int = 3, length: float = L) -> Modes:
    """Compute the lowest modes with n squares over the depth, on one rank."""
    corners = [np.array([0.0, -D / 2]), np.array([length, D / 2])]
    squares = dolfinx.mesh.CellType.quadrilateral
    cells = [round(length / D * n), n]
    mesh = dolfinx.mesh.create_rectangle(MPI.COMM_SELF, corners, cells, squares)
    V = function_space(mesh, lagrange(2, 2))
    u, w = ufl.TrialFunction(V), ufl.TestFunction(V)
    K, mu = lame(nu)
    dx = ufl.dx(domain=mesh, metadata={"quadrature_degree": 5})
    strain = ufl.sym(ufl.grad(u))
    stress = 2 * mu * strain + (K - 2 / 3 * mu) * ufl.div(u) * ufl.Identity(2)
    free = np.setdiff1d(np.arange(2 * V.dofmap.index_map.size_local), held(V))
    stiffness = matrix(ufl.inner(stress, ufl.grad(w)) * dx)[free][:, free]
    mass = matrix(RHO * ufl.inner(u, w) * dx)[free][:, free]
    squares_of_omega, modes = eigsh(stiffness, number, mass, sigma=0.0)

    start = dolfinx.fem.Function(V)
    start.interpolate(timoshenko(nu))
    momentum = mass @ start.x.array[free]
    # the modes of eigsh are orthonormal in M
    share = (modes.T @ momentum) ** 2 / (start.x.array[free] @ momentum)
    return Modes(np.sqrt(squares_of_omega), share)


def timoshenko(nu: float) -> Any:
    """Timoshenko's first mode as a function of coordinates 3 x points, for dolfinx to interpolate."""

    def displacement(x: Array) -> Array:
        w, phi, _, _ = mode(nu, x[0])
        return np.stack([-x[1] * phi, w])

    return displacement


def held(V: Any) -> Array:
    """Unknowns at the root."""
    nodes = dolfinx.fem.locate_dofs_geometrical(V, lambda x: np.isclose(x[0], 0.0))
    return np.concatenate([2 * nodes, 2 * nodes + 1])


def matrix(form: Any) -> sp.csr_matrix:
    """Assemble a bilinear form."""
    assembled = dolfinx.fem.petsc.assemble_matrix(dolfinx.fem.form(form))
    assembled.assemble()
    pointers, columns, values = assembled.getValuesCSR()
    size = assembled.size
    assembled.destroy()
    return sp.csr_matrix((values, columns, pointers), size)


def comparison() -> str:
    """Period and share of the first mode on finer meshes, compared with Timoshenko's theory."""
    lines = []
    for nu in NUS:
        theory = 2 * np.pi / first_bending(nu)
        for n in (2, 4, 8, 16):
            modes = solve(nu, n)
            period = 2 * np.pi / modes.omega[0]
            lines.append(
                f"nu = {nu:4}, {n:2} cells over the depth: period {period:.5f} s, "
                f"{100 * (period / theory - 1):+.3f} % from Timoshenko's {theory:.5f} s; the first "
                f"mode has {100 * modes.share[0]:.3f} % of the energy at the start"
            )
    return "\n".join(lines)


if __name__ == "__main__":
    run(comparison)
