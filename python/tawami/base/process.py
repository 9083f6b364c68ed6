"""Objects that cannot be doubled, and processes that are doubles."""

from __future__ import annotations

import os
from typing import NoReturn

from tawami.base.errors import InputError

_forked: list[int] = []
os.register_at_fork(after_in_child=lambda: _forked.append(os.getpid()))


class Unique:
    """What holds objects of MPI and PETSc: it cannot be copied, pickled or sent to another process."""

    def __reduce_ex__(self, protocol: object) -> NoReturn:
        """Asked for by `copy`, `deepcopy` and `pickle`."""
        raise InputError(
            f"a {type(self).__name__} cannot be copied, pickled or sent to another process: it holds "
            "objects of MPI and PETSc. Build another one there, and send its input or NumPy arrays"
        )


def check_process() -> None:
    """Whether this process was started, and not forked from one that uses MPI and threads.

    Raises:
        InputError: It was forked: what is called there may wait for ever.
    """
    if os.getpid() in _forked:
        raise InputError(
            "this process was forked from one with tawami in it, and neither MPI nor the threads of "
            "the particles survive that: expected multiprocessing.get_context('spawn'), or a process "
            "of its own as tawami.Study starts them"
        )
