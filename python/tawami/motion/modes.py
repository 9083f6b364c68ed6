"""Free vibrations of a scene about its present configuration: K x = omega^2 M x.

K is the tangent of the form at zero increments, M the lumped mass. In a mixed form M is zero on the
second field, which follows the displacement without inertia.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import ArpackNoConvergence, eigsh

from tawami.base import checks
from tawami.base.arrays import Array
from tawami.base.errors import ConvergenceError, InputError
from tawami.conditions.constraints import constraints
from tawami.particles import placement
from tawami.scene.scene import Scene
from tawami.solve.saddle import PROXIMAL

#: Asymmetry of the tangent that counts as round-off, relative to its largest entry.
ROUND_OFF = 1e-10


@dataclass(frozen=True)
class Modes:
    """Free vibrations, slowest first.

    Attributes:
        frequencies: [Hz]; 0 for a rigid motion, negative where the body is unstable and the motion grows
            (minus its rate over 2 pi).
        shapes: Displacements of the particles, modes x particles x dim, in the order of the body. Their
            sum over the mass, `sum_i m_i |u_i|^2`, is 1 [1/sqrt(kg per metre depth)] on the grid.
    """

    frequencies: Array
    shapes: Array


def modes(scene: Scene, number: int = 6) -> Modes:
    """Compute the slowest free vibrations of a scene in its present state, with its supports.

    Loads matter only through the stress that they have caused (at finite strain). Prescribed motions
    count as held.

    Args:
        scene: A scene with a density, without walls, on one rank.
        number: Of vibrations.

    Raises:
        InputError: Another scene, too many vibrations, or a form whose tangent has no symmetry.
        ConvergenceError: The eigenvalues were not found.
    """
    checks.instance("modes: scene", scene, Scene, "a tawami.Scene")
    number = checks.whole_number("modes: number", number, low=1)
    stiffness, mass, selection = _matrices(scene)
    most = int(np.count_nonzero(mass.diagonal())) - 1
    if number > most:
        raise InputError(f"modes: number = {number}: expected at most {most} for this scene")
    # slower than any wave across the grid, so that free rigid motions do not make it singular
    shift = -1e-6 * _fastest(stiffness, mass)
    try:
        found = eigsh(stiffness, number, mass, sigma=shift, v0=np.ones(mass.shape[0]))
    except ArpackNoConvergence as error:
        raise ConvergenceError(
            f"modes: only {len(error.eigenvalues)} of {number} vibrations were found. Request fewer",
            [],
        ) from None
    squares, vectors = found
    order = np.argsort(squares)
    squares, vectors = squares[order], vectors[:, order]
    # a value that the shift makes equal to zero belongs to a rigid motion
    squares[np.abs(squares) < 1e-6 * abs(shift)] = 0.0
    now = scene.configuration
    space, domain = now.model.space, now.domain
    n = domain.layout.num_displacement
    in_order = placement.in_order(scene.grid.comm, domain.particles.number)
    fields = [space.vectors((selection @ vector)[:n]) for vector in vectors.T]
    shapes = [in_order(domain.at_particles(field)) for field in fields]
    frequencies = np.sign(squares) * np.sqrt(np.abs(squares)) / (2 * np.pi)
    return Modes(frequencies, np.array(shapes))


def _matrices(scene: Scene) -> tuple[sp.csr_matrix, sp.csr_matrix, sp.csr_matrix]:
    """K and M of the unknowns and the multipliers of supports, and coefficients x unknowns."""
    now = scene.configuration
    if scene.grid.comm.size > 1:
        raise InputError(
            f"modes: {scene.grid.comm.size} ranks: expected one. Run it without mpirun"
        )
    if now.supports.walls:
        raise InputError("modes: the scene has walls, and contact is not linear: expected no walls")
    if now.obstacles.all:
        raise InputError(
            "modes: the scene has obstacles, and contact is not linear: expected no obstacles"
        )
    domain = now.domain
    size, n = domain.layout.size, domain.layout.num_displacement
    mass = np.zeros(size)
    mass[:n] = np.repeat(domain.lumped_mass, now.model.space.dim)
    zero = np.zeros(size)
    amounts = constraints(now.supports, domain, lambda support: 0.0, zero, zero, moving=True)
    reduction, _, supports = amounts
    selection = reduction.selection
    tangent = (selection.T @ scene.tangent(zero) @ selection).tocsr()
    largest = np.abs(tangent.data).max(initial=0.0)
    if np.abs((tangent - tangent.T).data).max(initial=0.0) > ROUND_OFF * largest:
        raise InputError(
            f"modes: the tangent of form {scene.form.name} is not symmetric: expected a form with a "
            "symmetric tangent, in which vibrations have real frequencies"
        )
    masses = (selection.T @ sp.diags(mass) @ selection).tocsr()
    if not supports:
        return tangent, masses, selection
    # multipliers of constraints, as in `tawami.solve.saddle`
    rows = sp.vstack([support.gradient.csr @ selection for support in supports])
    rows *= largest / np.abs(rows.data).max()
    count = rows.shape[0]
    tangent = sp.bmat([[tangent, rows.T], [rows, -PROXIMAL * largest * sp.eye(count)]]).tocsr()
    nothing = sp.csr_matrix((count, count))
    return (
        tangent,
        sp.block_diag([masses, nothing], "csr"),
        sp.hstack([selection, sp.csr_matrix((size, count))], "csr"),
    )


def _fastest(stiffness: sp.csr_matrix, mass: sp.csr_matrix) -> float:
    """About the largest omega^2."""
    diagonal, masses = stiffness.diagonal(), mass.diagonal()
    moving = masses > 0
    return float(np.max(diagonal[moving] / masses[moving]))
