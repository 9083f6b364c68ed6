"""The vibrating beam by finite elements, in plain dolfinx (0.5 to 0.11): beside it stands the MPM.

Biquadratic displacement, small strain, consistent mass, 3 x 3 Gauss points: K u = omega^2 M u.

python -m cases.verification.vibrating_beam.fem
"""

from __future__ import annotations

import logging
from dataclasses import dataclass
from typing import Any

import dolfinx.fem.petsc
import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
import ufl
from mpi4py import MPI
from scipy.sparse.linalg import eigsh

from cases.verification.vibrating_beam.beam import NUS, RHO, D, L, first_bending, lame, mode

Array = npt.NDArray[np.float64]

try:
    from basix.ufl import element

    function_space = dolfinx.fem.functionspace

    def biquadratic() -> Any:
        """Biquadratic displacement on squares."""
        return element("Lagrange", "quadrilateral", 2, shape=(2,))
except ImportError:  # dolfinx 0.5
    function_space = dolfinx.fem.FunctionSpace

    def biquadratic() -> Any:
        """Biquadratic displacement on squares."""
        return ufl.VectorElement("Lagrange", "quadrilateral", 2)


@dataclass(frozen=True)
class Modes:
    """The lowest modes.

    Attributes:
        omega: Angular frequencies [rad/s], ascending.
        share: Of the kinetic energy of a beam that starts with Timoshenko's first mode, in each.
    """

    omega: Array
    share: Array


def solve(nu: float, n: int = 8, number: int = 3) -> Modes:
    """The lowest modes on n squares over the depth, on one rank."""
    corners = [np.array([0.0, -D / 2]), np.array([L, D / 2])]
    squares = dolfinx.mesh.CellType.quadrilateral
    mesh = dolfinx.mesh.create_rectangle(MPI.COMM_SELF, corners, [round(L / D * n), n], squares)
    V = function_space(mesh, biquadratic())
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
    # eigsh makes the modes orthonormal in M
    share = (modes.T @ momentum) ** 2 / (start.x.array[free] @ momentum)
    return Modes(np.sqrt(squares_of_omega), share)


def timoshenko(nu: float) -> Any:
    """Timoshenko's first mode as dolfinx wants it: u(x) of 3 x points."""

    def displacement(x: Array) -> Array:
        w, phi, _, _ = mode(nu, x[0])
        return np.stack([-x[1] * phi, w])

    return displacement


def held(V: Any) -> Array:
    """Unknowns at the root."""
    nodes = dolfinx.fem.locate_dofs_geometrical(V, lambda x: np.isclose(x[0], 0.0))
    return np.concatenate([2 * nodes, 2 * nodes + 1])


def matrix(form: Any) -> sp.csr_matrix:
    """A bilinear form, assembled."""
    assembled = dolfinx.fem.petsc.assemble_matrix(dolfinx.fem.form(form))
    assembled.assemble()
    pointers, columns, values = assembled.getValuesCSR()
    size = assembled.size
    assembled.destroy()
    return sp.csr_matrix((values, columns, pointers), size)


def main() -> None:
    """Print period and share of the first mode beside Timoshenko's theory."""
    for nu in NUS:
        theory = 2 * np.pi / first_bending(nu)
        for n in (2, 4, 8, 16):
            modes = solve(nu, n)
            period = 2 * np.pi / modes.omega[0]
            print(
                f"nu = {nu:4}, {n:2} cells over the depth: period {period:.5f} s, "
                f"{100 * (period / theory - 1):+.3f} % from Timoshenko's {theory:.5f} s; of the "
                f"energy at the start {100 * modes.share[0]:.3f} % is in the first mode"
            )


if __name__ == "__main__":
    logging.disable(logging.INFO)  # the compilation of forms is talkative
    main()
