"""The exit codes that the documentation lists: 2 for a wrong command line, 1 for a run that fails."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys

import pytest
from programs import PYTHONPATH, ROOT

from tawami.command import main

MISUSE = """
tawami --nonsense | tawami dance | tawami | tawami case.py
tawami run | tawami run nowhere.py | tawami run . | tawami run text.txt | tawami run case.py --n 3
tawami run case.py --ranks 0 | tawami run case.py --ranks 100000 | tawami run case.py --ranks two
tawami run case.py --ranks
tawami run case.py -m case | tawami run case.py --resume --replace | tawami run -m no.such.module
tawami run case.py --log-level loud | tawami run run | tawami run case.py another.py
tawami resume | tawami resume nowhere | tawami resume . | tawami resume case.py | tawami resume run
tawami resume run -- --n 3 | tawami resume run --n 3
tawami plot | tawami plot nowhere | tawami plot . | tawami plot case.py | tawami plot run --movie avi
tawami plot run -- a
tawami new | tawami new case.py | tawami new class | tawami new two words | tawami new x --kind y
tawami form | tawami form chek | tawami form check | tawami form check no_form
tawami form check nowhere.py | tawami form check u --set alpha | tawami form check u --set k=1
tawami info --all | tawami info case.py
"""


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "text.txt").write_text("a b c")
    (tmp_path / "case.py").write_text("")
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "run.json").write_text("{}")
    return tmp_path


@pytest.mark.parametrize("command", [c.strip() for c in re.split(r"[|\n]", MISUSE) if c.strip()])
def test_a_wrong_command_line_has_the_exit_code_2(here, folder, command):
    run = here(*command.split()[1:], cwd=folder)
    assert run.returncode == 2, run.stdout + run.stderr
    assert run.stdout == ""
    assert run.stderr.splitlines()[-1].startswith("tawami")


def test_a_failure_has_the_exit_code_1(here, folder):
    (folder / "case.py").write_text("import tawami\ntawami.linear_elastic(E=-1.0, nu=0.3)\n")
    (folder / "form.py").write_text("fields = {}\n")
    (folder / "zero.py").write_text("1 / 0\n")
    (folder / "run" / "motion").mkdir()
    for command in ("run case.py", "run zero.py", "form check form.py", "new case.py/below"):
        run = here(*command.split(), cwd=folder)
        assert run.returncode == 1, run.stdout + run.stderr


def test_the_documentation_lists_them():
    text = (ROOT / "python" / "docs" / "command_line.md").read_text()
    table = text.partition("| exit code |")[2].partition("\n\n")[0]
    listed = set(re.findall(r"^\| (\d+)", table, flags=re.MULTILINE))
    assert listed == {"0", "1", "2", "128", "130", "143"}
    assert set(re.findall(r"\b\d+\b", main.CODES)) == listed - {"128"}


def ended_by(number: signal.Signals, script, *options: str, group: bool) -> tuple[int, str]:
    """Exit code and messages of a script that a signal ends while it waits."""
    run = subprocess.Popen(
        [sys.executable, "-m", "tawami", "run", str(script), *options, "--", "wait"],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True,
        env=os.environ | {"PYTHONPATH": PYTHONPATH},
    )  # fmt: skip
    assert run.stdout is not None
    while run.stdout.readline() != "waits\n":
        assert run.poll() is None
    (os.killpg if group else os.kill)(run.pid, number)
    _, errors = run.communicate(timeout=100)
    return run.returncode, errors


def test_ctrl_c_ends_a_script_without_a_traceback(script):
    assert ended_by(signal.SIGINT, script, group=True) == (130, "tawami run: interrupted\n")


@pytest.mark.mpi
@pytest.mark.parametrize(
    ("number", "group", "code", "message"),
    [
        (signal.SIGINT, True, 130, "interrupted"),
        (signal.SIGTERM, False, 143, "terminated"),
        pytest.param(signal.SIGINT, False, 130, "interrupted", marks=pytest.mark.slow),
        pytest.param(signal.SIGTERM, True, 143, "terminated", marks=pytest.mark.slow),
        pytest.param(signal.SIGHUP, False, 129, "terminated", marks=pytest.mark.slow),
    ],
)
def test_a_signal_ends_all_ranks(script, number, group, code, message):
    """Also one that only the command receives, and not mpirun: no rank is left behind."""
    ended = ended_by(number, script, "--ranks", "2", group=group)
    assert ended == (code, f"tawami run: {message}\n")
    running = subprocess.run(["ps", "-eo", "args"], capture_output=True, text=True, check=True)
    assert str(script) not in running.stdout
