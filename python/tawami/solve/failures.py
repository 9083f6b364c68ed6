"""Failures of MUMPS and PETSc that say nothing about the tangent: memory, limits of a library."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager

from petsc4py import PETSc

from tawami.base.errors import SolverError

#: INFOG(1) of MUMPS (users' guide, section "Error diagnostics") for a zero pivot or a singular matrix.
SINGULAR = (-6, -10)
#: INFOG(1) if memory or a workspace is too small.
MEMORY = (-5, -7, -8, -9, -11, -13, -14, -15, -17, -18, -19, -20, -22, -29)
#: INFOG(1) if a number exceeds an integer of 32 bits.
TOO_LARGE = (-51, -52)
#: PETSc's code of a failed allocation.
PETSC_MEMORY = 55
ADVICE = (
    "Use linear_solver='multigrid', which needs less memory, fewer cells, or more ranks on computers "
    "with more memory"
)


def of_mumps(code: int, detail: int, stage: str, unknowns: int) -> SolverError:
    """The error for a failure of MUMPS.

    Args:
        code: INFOG(1).
        detail: INFOG(2).
        stage: Stage of MUMPS, as "factorise".
        unknowns: Size of the tangent.
    """
    what = f"MUMPS could not {stage} the tangent of {unknowns} unknowns"
    found = f"(INFOG(1) = {code}, INFOG(2) = {detail})"
    if code in MEMORY:
        return SolverError(f"{what}: memory ran out {found}. {ADVICE}")
    if code in TOO_LARGE:
        return SolverError(f"{what}: it is too large for integers of 32 bits {found}. {ADVICE}")
    return SolverError(
        f"{what} {found}: see 'Error diagnostics' in the MUMPS users' guide. linear_solver='multigrid' "
        "does not use MUMPS"
    )


@contextmanager
def reported() -> Iterator[None]:
    """Raise errors of PETSc and failed allocations in the block as SolverError."""
    try:
        yield
    except PETSc.Error as error:
        *_, last = str(error).strip().splitlines()
        code = re.search(r"INFOG\(1\) ?= ?(-\d+)", last)  # MUMPS, where PETSc calls it to solve
        # the code is not always that of a failed allocation, but the functions are listed
        failed = error.ierr == PETSC_MEMORY or "PetscMalloc" in str(error)
        if failed or (code is not None and int(code[1]) in MEMORY):
            raise SolverError(f"PETSc: memory ran out ({last}). {ADVICE}") from error
        raise SolverError(f"PETSc could not solve the linear system: {last}") from error
    except MemoryError as error:
        raise SolverError(f"memory ran out for the linear system ({error}). {ADVICE}") from error
