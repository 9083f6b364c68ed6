"""The operators from which `multigrid` makes its preconditioner, field by field.

displacement   F = 2 mu eps : eps over the particles, never the deviator of a mixed form, which is nearly
               singular in three dimensions. Forms without a field for the volume have lambda tr eps
               tr eps as well. Inertia, ghost penalty and terms on the border add their stiffness.
               A form that takes the volume at the centres of the cells has its part of the tangent
volume         M, in the unknown p/mu; the multigrid solver adds what the tangent holds: (mu/K) M and the
               stabilisation
other fields   their part of the tangent
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp

from tawami.base import ranks
from tawami.base.petsc import aij
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
        volume: Whether its part of the tangent is subtracted from the operator.
    """

    name: str
    block: Block
    operator: Any
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
        if self._responses.form.own_fields:
            return "fields that no law receives, whose coupling multigrid does not know"
        if kinematics.has_mean_stress:
            if attachment.values.get("alpha", 1.0) == 0:
                return "alpha = 0: the pair of spaces is unstable"
            return ""
        mu, bulk = (self._responses.constants[name] for name in ("mu", "K"))
        ratio = ranks.largest(attachment.grid.comm, float((bulk / mu).max(initial=0.0)))
        if ratio > LOCKING:
            return f"K/mu up to {ratio:.3g} in a form without a field for the volume"
        return ""

    def parts(self, equations: Equations) -> list[Part]:
        """The fields of a tangent in the order of the form; a collective call."""
        return list(self._parts(equations))

    def _parts(self, equations: Equations) -> Iterator[Part]:
        attachment, layout = self._assembly.attachment, self._assembly.layout
        mu, bulk = (self._responses.constants[name] for name in ("mu", "K"))
        lame = np.minimum(bulk, STIFFEST * mu) - 2 / 3 * mu
        if layout.volumetric is not None:
            lame = np.zeros_like(mu)
        for name, place in layout.fields.items():
            block = Block(attachment, equations.reduction, place)
            operator = None
            if place.start == 0 and not self._responses.form.kinematics.volume_at_centre:
                moduli = np.ascontiguousarray(np.column_stack([mu, lame]))
                operator = block.assembled("elasticity", moduli)
                for rows in self._added(equations, block):
                    extra = aij(attachment.grid.comm, rows, block.num_own)
                    operator.axpy(1.0, extra)
                    extra.destroy()
            elif place is layout.volumetric:
                operator = block.assembled("mass", np.ascontiguousarray(mu[:, None]))
            yield Part(name, block, operator, place is layout.volumetric)

    def _added(self, equations: Equations, block: Block) -> Iterator[sp.csr_matrix]:
        """Rows of stiffness of the displacement beside that of the particles."""
        layout = self._assembly.layout
        penalty = self._assembly.penalty(self._responses.data)
        if penalty is not None:
            yield block.of_window(penalty)
        if equations.inertia is not None:
            mass = equations.inertia.slope * equations.inertia.mass
            mine = np.where(layout.own, np.pad(mass, (0, layout.size - len(mass))), 0.0)
            yield block.of_window(sp.diags(mine).tocsr())
        stiffness = None if equations.terms is None else equations.terms.stiffness
        if stiffness is not None:
            yield block.of_grid(((stiffness + stiffness.T) / 2).tocsr())
