"""Locks of folders: one process at a time writes results into a folder.

The lock is the system's lock of a file. It ends with its process, also on SIGKILL, so that nothing has
to be removed after a crash. The file systems of clusters share it between hosts. On a file system
without such locks, filelock marks the owner in the file instead, and takes over the mark of a process
of the same host that has ended.
"""

from __future__ import annotations

import os
import shlex
import sys
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

from tawami.base.errors import InputError, OutputError
from tawami.base.files import alive, atomic_file, host, reason, remove_leftovers, result_folder
from tawami.base.process import check_process

if TYPE_CHECKING:
    from filelock import BaseFileLock

#: Names of the locked file, and of the file that describes who holds the lock.
LOCK, OWNER = ".lock", ".owner"
#: Time that a process which is being killed has to end [s].
PATIENCE = 0.5
#: Characters of a command in a message.
LONG = 80


def hold(folder: Path, what: str, patience: float = PATIENCE) -> BaseFileLock:
    """Lock a folder for this process, until the lock is released or freed.

    A process can hold it several times. The first time, leftovers of killed processes are removed.

    Args:
        folder: Created if it does not exist.
        what: Its name in messages, as "Results('folder')".
        patience: Longest time to wait until another process releases it [s].

    Raises:
        InputError: Another process holds it; the message names its host and its number. Or this process
            was forked, and would write together with its parent.
        OutputError: The folder cannot be written, or its file system has no locks.
    """
    check_process()  # a fork shares the lock of its parent
    from filelock import FileLock, Timeout  # here: a scene without results does not need it

    home = result_folder(folder).resolve()
    lock = FileLock(home / LOCK, timeout=patience, is_singleton=True, thread_local=False)
    try:
        lock.acquire()
    except Timeout:
        raise InputError(
            f"{what}: {_owner(home)} writes into this folder: expected one run at a time in a folder. "
            "Wait until it ends, or choose another folder"
        ) from None
    except OSError as error:
        raise OutputError(
            f"{what}: '{home / LOCK}' cannot be locked ({reason(error)}): expected a folder with write "
            "permission, on a file system with locks; choose another one"
        ) from error
    if lock.lock_counter == 1:
        # on a full disk the messages of other processes do not name this one
        with suppress(OutputError), atomic_file(home / OWNER) as part:
            now = datetime.now(UTC).isoformat(timespec="seconds")
            part.write_text(f"{host()}\n{os.getpid()}\n{now}\n{shlex.join(sys.argv)}\n")
        remove_leftovers(home)
    return lock


def _owner(home: Path) -> str:
    """The process that holds the lock of a folder, for a message."""
    try:
        name, number, since, command, *_ = (home / OWNER).read_text(errors="replace").splitlines()
        lives = name != host() or alive(int(number))
    except (OSError, ValueError):
        return "another process"
    command = command if len(command) <= LONG else f"{command[: LONG - 3]}..."
    process = f"process {number} on host '{name}' ({command}, since {since})"
    return process if lives else f"a process that was started by {process}"
