"""Several ranks: sums and gathered arrays, errors that every rank raises, an end that all come to.

An error that one rank alone meets in a local block is raised on all of them
(:func:`raise_together`), so a driver script may catch it. What is left uncaught on any rank is printed
once and ends all of them (:func:`watch`): the others would wait for it for ever.
"""

from __future__ import annotations

import atexit
import os
import sys
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from types import TracebackType
from typing import Any, NoReturn

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from tawami.base import checks
from tawami.base.errors import TawamiError
from tawami.base.petsc import clean_up, stay

#: Seconds that each rank leaves to those before it to say what is wrong, and the longest wait.
COURTESY, LONGEST = 1.0, 4.0


def sum_of(comm: Any, values: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Sum of the ranks' arrays, in place."""
    if comm.size > 1:
        comm.Allreduce(MPI.IN_PLACE, values, op=MPI.SUM)
    return values


def any_of(comm: Any, mask: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
    """Where any rank's mask is set, in place."""
    if comm.size > 1:
        comm.Allreduce(MPI.IN_PLACE, mask, op=MPI.LOR)
    return mask


def allgathered(comm: Any, part: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """The ranks' arrays one after the other, on every rank."""
    if comm.size == 1:
        return part
    part = np.ascontiguousarray(part)
    entries = np.array(comm.allgather(part.size))
    whole = np.empty((int(entries.sum()) // int(np.prod(part.shape[1:], dtype=int)), *part.shape[1:]),
                     dtype=part.dtype)  # fmt: skip
    comm.Allgatherv(part, [whole, entries])
    return whole


def exchanged(comm: Any, rows: npt.NDArray[Any], to: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Rows of all ranks that belong to this one; `to` says where each of its own belongs."""
    parts = comm.alltoall([rows[to == rank] for rank in range(comm.size)])
    return np.concatenate(parts)


@contextmanager
def raise_together(comm: Any) -> Iterator[None]:
    """An error in the block, on whichever rank, is raised on all; the block must not communicate.

    Of several errors it is that of the lowest rank.
    """
    error = None
    try:
        yield
    except Exception as problem:
        if comm.size == 1:
            raise
        error = problem
    if comm.size == 1:
        return
    first = comm.allreduce(comm.size if error is None else comm.rank, op=MPI.MIN)
    if first == comm.size:
        return
    # what travels is raised on the first too: a driver catches the same type everywhere
    told = comm.bcast(_portable(error) if comm.rank == first else None, root=first)
    raise told from (error if comm.rank == first else None)


def _portable(error: Exception | None) -> Exception:
    """An exception that travels between ranks."""
    with suppress(Exception):
        MPI.pickle.loads(MPI.pickle.dumps(error))
        assert error is not None
        return error
    return RuntimeError(f"{type(error).__name__}: {error}")


def watch(comm: Any) -> None:
    """See to it that an uncaught error on one rank ends all ranks, and share the processors."""
    if comm.size == 1 or sys.excepthook is _end_all:
        return
    sys.excepthook = _end_all
    os.environ.setdefault("RAYON_NUM_THREADS", str(_processors(comm)))
    # at the end PETSc cleans up where something was dropped, and waits for ranks where nothing was
    stay(comm)
    atexit.register(clean_up, comm)


def _processors(comm: Any) -> int:
    """Processors of this rank, those that it shares with others of its machine in part."""
    machine = comm.Split_type(MPI.COMM_TYPE_SHARED)
    all_of_them = machine.allgather(os.sched_getaffinity(0))
    machine.Free()
    sharing = [sum(cpu in other for other in all_of_them) for cpu in os.sched_getaffinity(0)]
    return max(1, int(sum(1 / count for count in sharing) + 1e-9))


def _end_all(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
    _abort("".join(traceback.format_exception(kind, error, trace)))


def _abort(text: str) -> NoReturn:
    """Print a message, unless a rank before this one does, and end all ranks."""
    comm = MPI.COMM_WORLD
    time.sleep(min(COURTESY * comm.rank, LONGEST))
    sys.stderr.write(text)
    sys.stderr.flush()
    comm.Abort(1)
    raise SystemExit(1)


def own_environment() -> dict[str, str]:
    """The environment without what MPI put there for this process: its children are not its peers."""
    own = ("OMPI_", "PMIX_", "PRTE_")
    return {k: v for k, v in os.environ.items() if not k.startswith(own)}


def mpirun(number: int, command: list[str]) -> tuple[list[str], dict[str, str]]:
    """Command and environment that start several ranks, from a process that may be a rank itself.

    There may be more ranks than processors, and root may start them (containers).
    """
    environment = own_environment() | {
        "OMPI_ALLOW_RUN_AS_ROOT": "1",
        "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
        "OMPI_MCA_rmaps_base_oversubscribe": "1",
        "PRTE_MCA_rmaps_default_mapping_policy": ":oversubscribe",
    }
    return ["mpirun", "-n", str(number), *command], environment


def stop(text: str) -> NoReturn:
    """Print a message once and end all ranks, exit code 1."""
    if MPI.COMM_WORLD.size > 1:
        _abort(text)
    sys.exit(text.removesuffix("\n"))


def run(main: Callable[[], None], name: str) -> None:
    """Run a driver: an error of tawami becomes one line, on all ranks together, and exit code 1.

    Args:
        main: What to run; on several ranks only the first one's prints appear.
        name: What the line starts with.
    """
    comm = MPI.COMM_WORLD
    checks.instance("run: main", main, Callable, "a function without arguments")
    watch(comm)
    if comm.rank > 0:
        sys.stdout = open(os.devnull, "w")  # noqa: SIM115 - until the end of the process
    try:
        main()
    except TawamiError as error:
        notes = getattr(error, "__notes__", [])  # as that of `march`: when it was
        stop(f"{name}: {'; '.join([str(error), *notes])}\n")
    except SystemExit as end:  # sys.exit on one rank: the others would wait for it
        if comm.size == 1 or end.code in (0, None):
            raise
        _abort(f"{end.code}\n" if isinstance(end.code, str) else "")
