"""Several ranks under mpirun: signals are passed on, and an error that tawami printed is not repeated.

When a rank fails, tawami prints one message, and MPI adds blocks about exit codes. These are left out if
tawami has announced the end of the ranks, and printed at the end if it has not: a script may have called
`MPI.COMM_WORLD.Abort` itself. Everything else is printed at once: output of ranks, crashes, the rest.
"""

from __future__ import annotations

import os
import re
import select
import signal
import subprocess
import sys
from contextlib import suppress
from types import FrameType

from tawami.base import program

#: Lines of Open MPI 4, and of Open MPI 5 and 6 with PRRTE, about a program that ended with an exit code.
REPEATED = re.compile(
    r"""MPI_ABORT\ was\ invoked\ on\ rank\ .* | with\ errorcode\ -?\d+\.
    | Proc:\ .* | Errorcode:\ -?\d+
    | NOTE:\ invoking\ MPI_ABORT\ causes\ .* | You\ may\ or\ may\ not\ see\ output\ from\ .*
    | exactly\ when\ Open\ MPI\ kills\ them\.
    | Primary\ job\s+terminated\ normally,\ but\ .* | a\ non-zero\ exit\ code\..*
    | \S+\ detected\ that\ one\ or\ more\ processes\ exited\ with\ non-zero\ status,.*
    | (thus\ causing\ )?the\ job\ to\ be\ terminated\.\ The\ first\ process\ to\ do\ so\ was:
    | Process\ name:\ \[.* | Exit\ code:\s+\d+
    | \S+\ has\ exited\ due\ to\ process\ rank\ .*\ calling | "abort"\.\ This\ may\ have\ caused\ .*
    | terminated\ by\ signals\ sent\ by\ .*
    | \[.*\]\ .*ORTE_ERROR_LOG:\ .*\ in\ file\ \S*/show_help\.c\ at\ line\ \d+
    | \[.*\]\ \d+\ more\ process.*\ help\ message\ help-mpi-api\.txt\ /\ mpi-abort
    | \[.*\]\ Set\ MCA\ parameter\ "orte_base_help_aggregate"\ .*""",
    re.VERBOSE,
)
FRAME = re.compile("-{60,}")
#: First line of a block of Open MPI 5 about a variable that `program.mpirun` sets for all its versions.
OUTDATED = re.compile("A deprecated MCA variable value was specified .*")
#: Time after which a line that has not ended is printed [s].
PATIENCE = 0.2


def launch(number: int, command: list[str]) -> int:
    """Run a command on several ranks; return the exit code, 128 + the signal that ended it.

    mpirun is in a session of its own, so that it receives each signal once, from here: a second one
    would let it leave its ranks behind.
    """
    words, environment = program.mpirun(number, command)
    process = subprocess.Popen(
        words,
        env=environment | {program.ANNOUNCE: "1"},
        stderr=subprocess.PIPE,
        start_new_session=True,
    )
    arrived: list[int] = []

    def pass_on(received: int, _: FrameType | None) -> None:
        arrived.append(received)
        with suppress(ProcessLookupError):
            process.send_signal(signal.SIGINT if received == signal.SIGINT else signal.SIGTERM)

    before = {
        one: signal.signal(one, pass_on) for one in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    }
    try:
        _print_errors(process)
        code = process.wait()
    finally:
        for one, handler in before.items():
            signal.signal(one, handler)
    if arrived:
        how = "interrupted" if arrived[0] == signal.SIGINT else "terminated"
        print(f"tawami run: {how}", file=sys.stderr)
        return 128 + arrived[0]
    return 128 - code if code < 0 else code


def _print_errors(process: subprocess.Popen[bytes]) -> None:
    """Print the standard error of mpirun and of its ranks until it ends."""
    assert process.stderr is not None
    source, messages = process.stderr.fileno(), Messages()
    while True:
        ready = bool(select.select([source], [], [], PATIENCE)[0])
        part = os.read(source, 65536) if ready else b""
        _print(messages.passed(part) if part else messages.waiting())
        if not part and (ready or process.poll() is not None):
            break
    _print(messages.rest())


def _print(text: bytes) -> None:
    if text:
        sys.stderr.buffer.write(text)
        sys.stderr.buffer.flush()


class Messages:
    """Text on standard error: lines to print at once, and lines that only repeat an error."""

    def __init__(self) -> None:
        self._line = b""  # has not ended
        self._begun = False  # whether the begin of this line is printed
        self._frame = b""  # a line of dashes, whose meaning the next text decides
        self._inside = False  # a block that repeats an error
        self._outdated = False  # a block about an outdated variable
        self._repeated: list[bytes] = []
        self._announced = False

    def passed(self, part: bytes) -> bytes:
        """Text to print after this part has arrived."""
        part = part.replace(b"\0", b"")  # Open MPI 5.0.7 prints one after its last block
        *lines, self._line = (self._line + part).split(b"\n")
        return b"".join(self._sorted(line + b"\n") for line in lines)

    def waiting(self) -> bytes:
        """Text to print if nothing arrives for a while; a line of dashes waits for the next line."""
        return self._all() if self._line else b""

    def _all(self) -> bytes:
        text, self._frame, self._line = self._frame + self._line, b"", b""
        self._begun = self._begun or not (not text or text.endswith(b"\n"))
        return text

    def rest(self) -> bytes:
        """Text to print at the end."""
        return self._all() + (b"" if self._announced else b"".join(self._repeated))

    def _sorted(self, line: bytes) -> bytes:
        """Text to print after this line."""
        line, ended, _ = line.partition(f"{program.ENDED}\n".encode())
        self._announced = self._announced or bool(ended)
        text = line.decode(errors="replace").strip()
        if self._outdated:
            self._outdated = not FRAME.fullmatch(text)
            return b""
        if self._frame and OUTDATED.fullmatch(text):
            self._frame, self._outdated = b"", True
            return b""
        if ended or self._begun:
            self._begun = False
        elif FRAME.fullmatch(text):
            if self._inside:
                self._repeated.append(line)
                self._inside = False
                return b""
            before, self._frame = self._frame, line
            return before
        elif self._frame and not text:  # Open MPI 6
            self._frame += line
            return b""
        elif REPEATED.fullmatch(text) or (self._inside and not text):
            self._inside = self._inside or bool(self._frame)
            self._repeated += [self._frame, line]
            self._frame = b""
            return b""
        before, self._frame = self._frame, b""
        return before + line
