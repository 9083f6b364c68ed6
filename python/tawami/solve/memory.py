"""Memory that a linear solver needs, estimated before it is allocated."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from mpi4py import MPI

from tawami.base.errors import SolverError

#: Bytes of the factors of MUMPS for n unknowns, divided by n log2(n), and their growth without symmetry
#: (`cases.costs.solvers` measures them).
FACTORS, UNSYMMETRIC = 300.0, 1.6
#: Bytes that multigrid needs for each entry of the tangent, without those of the tangent: operators, and
#: the vectors of 30 iterations.
OPERATORS = 24.0
#: Memory that is not checked [bytes].
LITTLE = 1e8


def of_factors(unknowns: int, *, symmetric: bool) -> float:
    """Bytes of a factorisation of the tangent of a plane grid."""
    bytes_ = FACTORS * unknowns * math.log2(max(unknowns, 2))
    return bytes_ if symmetric else UNSYMMETRIC * bytes_


def of_multigrid(matrix: Any) -> float:
    """Bytes of the operators of multigrid for a tangent; a call for all ranks."""
    return float(OPERATORS * matrix.getInfo(matrix.InfoType.GLOBAL_SUM)["nz_used"])


def available(comm: Any) -> float:
    """Free memory of the computers that the ranks run on [bytes]; infinite if unknown."""
    try:
        lines = Path("/proc/meminfo").read_text().splitlines()
        free = 1024.0 * next(int(x.split()[1]) for x in lines if x.startswith("MemAvailable"))
    except (OSError, StopIteration, ValueError):
        free = math.inf
    here = comm.Split_type(MPI.COMM_TYPE_SHARED)
    share = free / here.size
    here.Free()
    return float(comm.allreduce(share))


def check(comm: Any, method: str, unknowns: int, need: float, advice: str) -> None:
    """Check that memory suffices; a call for all ranks.

    Args:
        comm: Communicator.
        method: Method that needs it, in words.
        unknowns: Number of unknowns.
        need: Estimated memory [bytes].
        advice: What to do.

    Raises:
        SolverError: It does not.
    """
    if need < LITTLE:
        return
    free = available(comm)
    if need > free:
        fits = int(unknowns * free / need)
        raise SolverError(
            f"{method} for {unknowns} unknowns needs about {need / 1e9:.2g} GB and {free / 1e9:.2g} GB "
            f"of memory are free: expected at most about {fits} unknowns. {advice}"
        )
