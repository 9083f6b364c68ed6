"""Errors on several ranks: one message, the exit code of the program, and nothing else is lost."""

from __future__ import annotations

import signal

import pytest

from tawami.base.program import ENDED
from tawami.command.launch import Messages

DASHES = "-" * 74 + "\n"
ABORT_4 = f"""{DASHES}MPI_ABORT was invoked on rank 0 in communicator MPI_COMM_WORLD
with errorcode 1.

NOTE: invoking MPI_ABORT causes Open MPI to kill all MPI processes.
You may or may not see output from other processes, depending on
exactly when Open MPI kills them.
{DASHES}"""
EXIT_4 = f"""{DASHES}Primary job  terminated normally, but 1 process returned
a non-zero exit code. Per user-direction, the job has been aborted.
{DASHES}{DASHES}mpirun detected that one or more processes exited with non-zero status, thus causing
the job to be terminated. The first process to do so was:

  Process name: [[7274,1],1]
  Exit code:    3
{DASHES}"""
TORN_4 = (
    "[vm:28734] [[7360,0],0] ORTE_ERROR_LOG: Out of resource in file ../../../orte/util/show_help.c "
    "at line 507\n"
)
MORE_4 = (
    "[vm:28734] 1 more process has sent help message help-mpi-api.txt / mpi-abort\n"
    '[vm:28734] Set MCA parameter "orte_base_help_aggregate" to 0 to see all help / error messages\n'
)
ABORT_5 = f"""{DASHES}MPI_ABORT was invoked on rank 1 in communicator MPI_COMM_WORLD
  Proc: [[51247,1],1]
  Errorcode: 1

NOTE: invoking MPI_ABORT causes Open MPI to kill all MPI processes.
You may or may not see output from other processes, depending on
exactly when Open MPI kills them.
{DASHES}{DASHES}prterun has exited due to process rank 1 with PID 0 on node vm calling
"abort". This may have caused other processes in the application to be
terminated by signals sent by prterun (as reported here).
{DASHES}"""
EXIT_5 = f"""{DASHES}prterun detected that one or more processes exited with non-zero status,
thus causing the job to be terminated. The first process to do so was:

   Process name: [prterun-vm-4711@1,1] Exit code:    3
{DASHES}"""
ABORT_6 = ABORT_5.replace(2 * DASHES, f"{2 * DASHES}\n")
EXIT_6 = EXIT_5.replace(DASHES, f"{DASHES}\n", 1).replace("] Exit", "]\n   Exit")
CRASH_4 = f"""{DASHES}mpirun noticed that process rank 1 with PID 0 on node n exited on signal 6 (Abort).
{DASHES}"""
CRASH_5 = f"""{DASHES}prterun noticed that process rank 1 with PID 4712 on node vm exited on
signal 9 (Killed).
{DASHES}"""
SLOTS = f"""{DASHES}There are not enough slots available in the system to satisfy the 9
slots that were requested by the application:

  python

Either request fewer procs for your application, or make more slots available for use.
{DASHES}"""
OUTDATED_5 = f"""{DASHES}A deprecated MCA variable value was specified in the environment or
on the command line.  Deprecated MCA variables should be avoided;
they may disappear in future releases.

  Deprecated variable: rmaps_default_mapping_policy
  New variable:        mapby
{DASHES}"""
OWN = f"first\n{DASHES}a table of the script\n\n{DASHES}last, without an end of line"
REPEATED = [ABORT_4, EXIT_4, TORN_4, MORE_4, ABORT_5, EXIT_5, ABORT_6, EXIT_6]


def printed(text: str, size: int) -> str:
    """Printed part of a text that arrives in parts."""
    messages, data = Messages(), text.encode()
    parts = [messages.passed(data[k : k + size]) for k in range(0, len(data), size)]
    return (b"".join(parts) + messages.rest()).decode()


@pytest.mark.parametrize("size", [1, 7, 100000])
def test_messages_that_repeat_an_error_are_left_out_and_no_others(size):
    error = f"case.py: E = -1: expected a modulus\n{ENDED}\n"
    for repeated in REPEATED:
        for other in (CRASH_4, CRASH_5, SLOTS, OWN):
            kept = error.replace(f"{ENDED}\n", "") + other
            assert printed(error + repeated + other, size) == kept
            assert printed(repeated + error + other, size) == kept
        assert printed(f"progress{error}{repeated}", size).startswith("progresscase.py")
    assert printed(error + ABORT_5 + "\0", size) == error.replace(f"{ENDED}\n", "")


@pytest.mark.parametrize("repeated", [ABORT_4, EXIT_4, ABORT_5, EXIT_5, ABORT_6, EXIT_6])
def test_messages_that_arrive_slowly_are_left_out(repeated):
    messages, text = Messages(), f"error\n{ENDED}\n"
    seen = messages.passed(text.encode())
    for line in repeated.splitlines(keepends=True):
        seen += messages.passed(line.encode()) + messages.waiting()
    assert seen + messages.rest() == b"error\n"


@pytest.mark.parametrize("repeated", REPEATED)
def test_without_an_announced_error_everything_is_printed(repeated):
    assert printed(OWN + "\n" + repeated, 11) == OWN + "\n" + repeated
    assert sorted(printed(repeated + CRASH_4, 100).splitlines()) == sorted(
        (repeated + CRASH_4).splitlines()
    )


@pytest.mark.parametrize("size", [1, 7, 100000])
def test_a_message_about_an_outdated_variable_is_left_out(size):
    assert printed(OUTDATED_5, size) == ""
    for other in (OWN, CRASH_5, SLOTS):
        assert printed(OUTDATED_5 + other, size) == other
    assert printed(OUTDATED_5 + EXIT_5, size) == EXIT_5


def test_a_line_that_has_not_ended_is_printed_after_a_while():
    messages = Messages()
    assert messages.passed(b"50 %") == b""
    assert messages.waiting() == b"50 %"
    assert messages.passed(b" of the steps\r") == b""
    assert messages.waiting() == b" of the steps\r"
    assert messages.passed(f"\nend{ENDED}\n".encode()) == b"\nend"
    assert messages.rest() == b""


FAILURES = """
import os, signal, sys
from mpi4py import MPI
what, rank = sys.argv[1], MPI.COMM_WORLD.rank
if what == "all":
    import tawami
    tawami.linear_elastic(E=-1.0, nu=0.3)
if what == "crash" and rank == 1:
    os.kill(os.getpid(), signal.SIGKILL)
if what == "exit":
    sys.exit(7)
if what == "one" and rank == 1:
    1 / 0
if what == "abort" and rank == 1:
    MPI.COMM_WORLD.Abort(5)
MPI.COMM_WORLD.Barrier()
"""


@pytest.mark.mpi
@pytest.mark.parametrize(
    ("what", "code", "message"),
    [
        ("all", 1, "fails.py: linear_elastic: E = -1: expected a positive, finite modulus in Pa\n"),
        ("crash", 128 + signal.SIGKILL, None),
        pytest.param("exit", 7, "", marks=pytest.mark.slow),
        pytest.param("one", 1, "Traceback", marks=pytest.mark.slow),
        pytest.param("abort", 5, None, marks=pytest.mark.slow),
    ],
)
def test_an_error_on_ranks_is_printed_once(process, tmp_path, what, code, message):
    script = tmp_path / "fails.py"
    script.write_text(FAILURES)
    run = process("run", script, "--ranks", 2, "--", what)
    assert run.returncode == code, run.stderr
    if message == "Traceback":
        assert run.stderr.startswith(message)
        assert run.stderr.endswith("\nZeroDivisionError: division by zero\n")
        assert run.stderr.count(message) == 1
    elif message is not None:
        assert run.stderr == message
    if what == "crash":
        assert "rank 1" in run.stderr
        assert "signal 9 (Killed)" in run.stderr.replace("\n", " ")
