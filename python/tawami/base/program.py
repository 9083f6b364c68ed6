"""Programs on several ranks: how they start, and how an error on one rank ends all of them.

An error that nothing catches is printed once and ends all ranks (:func:`watch`), and so does sys.exit on
one rank in a function that tawami calls (:func:`leave_together`). The others would wait forever.
"""

from __future__ import annotations

import atexit
import os
import sys
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import TracebackType
from typing import Any, NoReturn

from mpi4py import MPI

from tawami.base import checks
from tawami.base.errors import TawamiError
from tawami.base.petsc import clean_up, keep_communicator

#: Seconds that a rank gives each rank before it to print its message first, and the longest wait.
COURTESY, LONGEST = 1.0, 4.0
#: Seconds in which all ranks must call sys.exit if one does, and after which a rank that has reached the
#: end of the program reports that others have not.
GRACE, NOTICE = 10.0, 60.0
#: Environment variables without which mpirun does not start for root.
AS_ROOT = ("OMPI_ALLOW_RUN_AS_ROOT", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM")
#: Environment variable with which `tawami run --ranks` asks for a line on standard error when an error
#: that is printed ends all ranks, and this line.
ANNOUNCE, ENDED = "TAWAMI_ANNOUNCE", "\x1dtawami: an error ends all ranks"
#: A communicator for the end of the program alone, and the request of this rank that ends with it.
_end: list[Any] = []


def watch(comm: Any) -> None:
    """Let an uncaught error on one rank end all ranks, and share the processors among the ranks."""
    if comm.size == 1 or sys.excepthook is _end_all:
        return
    sys.excepthook = _end_all
    os.environ.setdefault("RAYON_NUM_THREADS", str(_processors(comm)))
    # at exit PETSc frees dropped objects in a call for all ranks: every rank must make it
    keep_communicator(comm)
    _end.append(comm.Dup())
    atexit.register(_finish, comm)


def _all_end(patience: float) -> bool:
    """Whether all ranks come here, or to the end of the program, within some seconds."""
    if len(_end) == 1:
        _end.append(_end[0].Ibarrier())
    until = time.monotonic() + patience
    while not _end[1].Test():
        if time.monotonic() > until:
            return False
        time.sleep(0.01)
    return True


def _finish(comm: Any) -> None:
    """Wait for the other ranks at the end of the program, and free the remaining objects."""
    if not _all_end(NOTICE):
        sys.stderr.write(
            f"tawami: rank {comm.rank} reached the end of the program {NOTICE:g} s ago, other ranks "
            "have not. If it called sys.exit, they may wait for it forever: interrupt the program, "
            "and call sys.exit on all ranks\n"
        )
        _end[1].Wait()
    clean_up(comm)


@contextmanager
def leave_together() -> Iterator[None]:
    """End all ranks if one rank, and not all of them, calls sys.exit in the block."""
    try:
        yield
    except SystemExit as end:
        if not _end:
            raise
        rank = MPI.COMM_WORLD.rank
        if not _all_end(GRACE):
            _abort(
                f"sys.exit({end.code!r}) was called on rank {rank} and not on all ranks. The others "
                "would wait for it, so all ranks end\n",
                end.code if isinstance(end.code, int) and end.code else 1,
            )
        if isinstance(end.code, str) and rank:
            end.code = 1  # the first rank prints the text
        if end.code:
            _announce()
        raise


def _processors(comm: Any) -> int:
    """Processors of this rank; those shared with other ranks of the machine count in part."""
    machine = comm.Split_type(MPI.COMM_TYPE_SHARED)
    all_of_them = machine.allgather(os.sched_getaffinity(0))
    machine.Free()
    sharing = [sum(cpu in other for other in all_of_them) for cpu in os.sched_getaffinity(0)]
    return max(1, int(sum(1 / count for count in sharing) + 1e-9))


def _end_all(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
    _abort("".join(traceback.format_exception(kind, error, trace)))


def _abort(text: str, code: int = 1) -> NoReturn:
    """Print a message, unless a lower rank does, and end all ranks with an exit code."""
    comm = MPI.COMM_WORLD
    time.sleep(min(COURTESY * comm.rank, LONGEST))
    sys.stderr.write(text)
    _announce()
    comm.Abort(code)
    raise SystemExit(code)


def _announce() -> None:
    """Tell the process that started the ranks that messages of MPI would only repeat an error."""
    if ANNOUNCE in os.environ:
        sys.stderr.write(f"{ENDED}\n")
    sys.stderr.flush()


def own_environment() -> dict[str, str]:
    """The environment without the variables of MPI: a child process is not a rank of this program."""
    own = ("OMPI_", "PMIX_", "PRTE_", ANNOUNCE)
    return {k: v for k, v in os.environ.items() if not k.startswith(own)}


def mpirun(number: int, command: list[str]) -> tuple[list[str], dict[str, str]]:
    """Command and environment that start several ranks, also from a process that is a rank itself.

    There may be more ranks than processors, and root may start them, as in containers.
    """
    environment = own_environment() | {
        **dict.fromkeys(AS_ROOT, "1"),
        "OMPI_MCA_rmaps_base_oversubscribe": "1",
        "PRTE_MCA_rmaps_default_mapping_policy": ":oversubscribe",
    }
    return ["mpirun", "-n", str(number), *command], environment


def stop(text: str) -> NoReturn:
    """Print a message once and end all ranks with exit code 1."""
    if MPI.COMM_WORLD.size > 1:
        _abort(text)
    sys.exit(text.removesuffix("\n"))


def run(main: Callable[[], None], name: str) -> None:
    """Run a driver; an error of tawami becomes one line and exit code 1, on all ranks.

    Args:
        main: Function without arguments. On several ranks only the first one prints.
        name: First word of the line.
    """
    comm = MPI.COMM_WORLD
    checks.instance("run: main", main, Callable, "a function without arguments")
    watch(comm)
    if comm.rank > 0:
        sys.stdout = open(os.devnull, "w")  # noqa: SIM115 - until the end of the process
    try:
        with leave_together():
            main()
    except TawamiError as error:
        notes = getattr(error, "__notes__", [])  # as the time of a step that failed
        stop(f"{name}: {'; '.join([str(error), *notes])}\n")
