"""The operators from which `multigrid` makes its preconditioner, field by field.

displacement   F = 2 mu (eps : eps - tr eps^2 / 6) over the particles. The deviator of a mixed form has
               1/3 instead of 1/6 and is nearly singular in three dimensions. Forms without a field for
               the volume have 2 mu eps : eps + lambda tr eps^2. Inertia, ghost penalty and terms on the
               border add their stiffness. A form that takes the volume at the centres of the cells has
               its part of the tangent
volume         M, in the unknown p/mu; the multigrid solver takes half of it and adds what the tangent
               holds: (mu/K) M and the stabilisation
other fields   their part of the tangent
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
from petsc4py import PETSc

from tawami.base import ranks
from tawami.base.arrays import Array
from tawami.base.petsc import aij, diagonal_of
from tawami.field.assembly import Assembly
from tawami.field.block import Block
from tawami.particles.responses import Responses
from tawami.solve.equations import Equations

#: K/mu (nu = 0.475) beyond which multigrid takes many iterations without a field for the volume.
LOCKING = 20.0
#: K/mu up to which the operator of a form without a field for the volume counts.
STIFFEST = 1e4


@dataclass(frozen=True)
class Part:
    """One field of a tangent.

    Attributes:
        name: Name of the field.
        block: Its unknowns.
        operator: Its operator, before scaling; None for its part of the tangent.
        mass: The mass matrix of a scalar field, before scaling; None for the displacement.
        share: What the displacement, and the volume that follows it, yield to each of this rank's
            unknowns of a field without a role, relative to the displacement alone.
        volume: Whether it is the volumetric strain or the pressure.
    """

    name: str
    block: Block
    operator: Any = None
    mass: Any = None
    share: Array | float = 1.0
    volume: bool = False


class Operators:
    """Makes the operators of a scene.

    Args:
        assembly: Residual and tangent of the form.
        responses: The particles.
    """

    def __init__(self, assembly: Assembly, responses: Responses) -> None:
        self._assembly, self._responses = assembly, responses

    @property
    def unsuited(self) -> str:
        """Reason for which multigrid does not suit the form; empty if it does."""
        kinematics, attachment = self._responses.form.kinematics, self._assembly.attachment
        if kinematics.has_mean_stress:
            if attachment.values.get("alpha", 1.0) == 0:
                return "alpha = 0: the pair of spaces is unstable"
            return ""
        mu, bulk = (self._responses.constants[name] for name in ("mu", "K"))
        ratio = ranks.largest(attachment.grid.comm, float((bulk / mu).max(initial=0.0)))
        if ratio > LOCKING:
            return f"K/mu up to {ratio:.3g} in a form without a field for the volume"
        return ""

    @property
    def _is_elastic(self) -> bool:
        """Whether the displacement's part of the tangent is about that of the elastic body."""
        form = self._responses.form
        return not (form.own_fields or form.kinematics.volume_at_centre)

    def parts(self, equations: Equations) -> list[Part]:
        """The fields of a tangent in the order of the form; a collective call."""
        return list(self._parts(equations))

    def _parts(self, equations: Equations) -> Iterator[Part]:
        attachment, layout = self._assembly.attachment, self._assembly.layout
        mu, bulk = (self._responses.constants[name] for name in ("mu", "K"))
        lame = np.minimum(bulk, STIFFEST * mu) - 2 / 3 * mu
        if layout.volumetric is not None:
            lame = -mu / 3
        for name, place in layout.fields.items():
            block = Block(attachment, equations.reduction, place)
            if place.start > 0:
                yield self._scalar(name, block, place is layout.volumetric)
                continue
            operator = None
            if self._is_elastic:
                moduli = np.ascontiguousarray(np.column_stack([mu, lame]))
                operator = block.assembled("elasticity", moduli)
                for rows, structure in self._added(equations, block):
                    extra = aij(attachment.grid.comm, rows, block.num_own)
                    operator.axpy(1.0, extra, structure)
                    extra.destroy()
            yield Part(name, block, operator)

    def _scalar(self, name: str, block: Block, volume: bool) -> Part:
        """A field that follows the displacement."""
        mu, bulk = (self._responses.constants[name] for name in ("mu", "K"))
        if volume:
            return Part(name, block, mass=block.assembled("mass", mu[:, None]), volume=True)
        masses = [
            block.assembled("mass", np.ascontiguousarray(weight[:, None]))
            for weight in (mu / (bulk + 4 / 3 * mu), np.ones_like(mu))
        ]
        weighted, plain = map(diagonal_of, masses)
        share = 2 * weighted / np.maximum(plain, np.finfo(float).tiny)
        return Part(name, block, mass=masses[1], share=share)

    def _added(
        self, equations: Equations, block: Block
    ) -> Iterator[tuple[sp.csr_matrix, PETSc.Mat.Structure]]:
        """Rows of stiffness of the displacement beside that of the particles, and their pattern."""
        layout, structure = self._assembly.layout, PETSc.Mat.Structure
        if equations.inertia is not None:
            mass = equations.inertia.slope * equations.inertia.mass
            mine = np.where(layout.own, np.pad(mass, (0, layout.size - len(mass))), 0.0)
            rows = block.of_window(sp.diags(mine).tocsr())
            yield rows, structure.SUBSET_NONZERO_PATTERN
        penalty = self._assembly.penalty(self._responses.data)
        if penalty is not None:
            yield block.of_window(penalty), structure.DIFFERENT_NONZERO_PATTERN
        terms = equations.terms
        if terms is not None and terms.stiffness is not None:
            symmetric = ((terms.stiffness + terms.stiffness.T) / 2).tocsr()
            rows = block.of_window(symmetric, terms.far)
            yield rows, structure.DIFFERENT_NONZERO_PATTERN
