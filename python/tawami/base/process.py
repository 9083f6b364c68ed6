"""Objects that cannot be copied, and processes that were forked."""

from __future__ import annotations

import os
from typing import NoReturn

from tawami.base.errors import InputError

_forked: list[int] = []
os.register_at_fork(after_in_child=lambda: _forked.append(os.getpid()))


class Unique:
    """Base of objects that hold MPI and PETSc objects: no copy, no pickle."""

    def __reduce_ex__(self, protocol: object) -> NoReturn:
        """Raise an error; `copy`, `deepcopy` and `pickle` call this."""
        raise InputError(
            f"a {type(self).__name__} cannot be copied, pickled or sent to another process: it holds "
            "objects of MPI and PETSc. Build another one there, and send its input or NumPy arrays"
        )


def check_process() -> None:
    """Check that this process was not forked from one that uses MPI and threads.

    Raises:
        InputError: It was forked; calls could wait forever.
    """
    if os.getpid() in _forked:
        raise InputError(
            "this process was forked from one that uses tawami, where neither MPI nor the threads of "
            "the particles work: expected a process that was spawned; use "
            "multiprocessing.get_context('spawn'), or tawami.Study"
        )
