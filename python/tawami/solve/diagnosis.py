"""What to say of a tangent that cannot be solved: where it is weak, and why."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from tawami import _rust
from tawami.base import ranks
from tawami.field.reduction import Reduction
from tawami.field.reference import Field
from tawami.form.kinematics import Kinematics

Array = npt.NDArray[np.float64]
#: K/mu at which forms without a field for the volume have no digit left.
NO_DIGITS = 1e9
#: Largest over least shear modulus from which round-off of the stiff may reach Newton's tolerance.
FEW_DIGITS = 1e8
#: Advice where the tangent was regular when the step began.
BEYOND = (
    "the load, for the tangent was regular when the step began: it is more than the material can bear, "
    "or than one step can. Nothing was changed in the particles. Take a smaller load, or ramp(...)"
)


def weakest(
    field: Field, location: _rust.Location, reduction: Reduction, direction: Array
) -> list[str]:
    """The cells that a singular system is weakest in, in words; a call for all ranks.

    Args:
        field: The field side.
        location: Where this rank's particles are.
        reduction: The unknowns.
        direction: This rank's entries of the direction that the system is weakest in.
    """
    grid = field.grid
    own = np.argsort(-np.abs(direction))[:20]
    entries = ranks.allgathered(grid.comm, np.abs(direction[own]))
    unknowns = ranks.allgathered(grid.comm, reduction.own.start + own)
    counts = np.bincount(location.cell, minlength=grid.cells[0] * grid.cells[1])
    counts = ranks.sum_of(grid.comm, counts)
    found: list[str] = []
    for unknown in unknowns[np.argsort(-entries, kind="stable")][:20]:
        cells = field.layout.cells_of(reduction.unknowns[unknown])
        number = counts[cells @ [1, grid.cells[0]]]
        i, j = cells[number.argmin()]
        text = f"({i}, {j}) with {number.min()} particles"
        if text not in found:
            found.append(text)
    return found[:4]


def lost_digits(comm: Any, ratio: Array, kinematics: Kinematics) -> str:
    """What to do where K/mu is beyond a form without a field for the volume; nothing elsewhere.

    Args:
        comm: Communicator.
        ratio: K/mu of this rank's particles.
        kinematics: Of the form.
    """
    stiff = comm.allreduce(float(ratio.max(initial=0.0)), op=MPI.MAX)
    if stiff < NO_DIGITS or kinematics.volume_fields:
        return ""
    return (
        f"K/mu is {stiff:.1e}: without a field for the volume no digit is left at that; use form "
        "'u_epsv' or 'u_p'"
    )


def contrast(comm: Any, mu: Array) -> str:
    """What to do where the materials are too different; nothing elsewhere.

    Args:
        comm: Communicator.
        mu: Shear modulus of this rank's particles [Pa].
    """
    largest = comm.allreduce(float(mu.max(initial=0.0)), op=MPI.MAX)
    least = comm.allreduce(float(mu.min(initial=np.inf)), op=MPI.MIN)
    if largest < FEW_DIGITS * least:
        return ""
    return (
        f"shear moduli differ by a factor of {largest / least:.1e}, and round-off of the stiff material "
        "is as large as the forces of the soft one; make the stiff one softer, or hold it by supports"
    )


def sentence(basis: str, condition: float, cells: list[str], advice: str) -> str:
    """Condition, cells and likely cause of a singular tangent."""
    size = "infinite" if np.isinf(condition) else f"about {condition:.1e}"
    advice = advice or (
        "the particles do not stiffen every function of the grid. Use more particles per cell, the "
        "basis 'quadratic_spline', or alpha > 0"
    )
    return (
        f"the tangent is singular (condition number of the scaled matrix: {size}; from its "
        f"factorisation and random vectors). The displacement basis is '{basis}'; weakest at the cells "
        f"(i, j): {', '.join(cells)}. Likely cause: {advice}"
    )
