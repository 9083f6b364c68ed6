"""`tawami run`: a script runs as Python runs it; a user's mistake is one line."""

from __future__ import annotations

import pytest
from programs import python

from tawami.command import main
from tawami.command.script import Script


def test_a_script_runs_as_python_runs_it(script, process):
    run = process("run", script.name, "--replace", "--log-level", "debug", "--", "a", "--b",
                  cwd=script.parent)  # fmt: skip
    as_python = python(script, "a", "--b", cwd=script.parent, check=True)
    assert run.returncode == 0, run.stderr
    first, second = run.stdout.splitlines()
    assert first == as_python.stdout.splitlines()[0]
    assert second == "replace debug"


def test_a_module_runs_as_python_runs_it(script, here):
    run = here("run", "-m", "case", "--resume", "--", "a", cwd=script.parent)
    assert run.returncode == 0, run.stderr
    path = str(script.parent)
    assert run.stdout.splitlines() == [
        f"__main__ {script} {[str(script), 'a']} {path} {path}",
        "resume None",
    ]


@pytest.mark.parametrize("way", ["", "exit"])
def test_an_option_without_effect_is_reported(script, here, way):
    text = script.read_text().replace("sys.exit(3)", "sys.exit(0)")
    script.write_text(text)
    for option in ("--resume", "--replace"):
        run = here("run", script, option, "--", way)
        assert run.returncode == 0
        assert run.stderr == (
            f"case.py: {option} had no effect: the script ran from its beginning, and wrote no results "
            "with tawami.Results(...) and results=...\n"
        )
    assert here("run", script, "--", way).stderr == ""


def test_the_traceback_of_a_script_begins_in_the_script(script, process):
    fails = process("run", script, "--", "fails")
    assert fails.returncode == 1
    lines = fails.stderr.splitlines()
    assert lines[0] == "Traceback (most recent call last):"
    assert lines[1].strip().startswith(f'File "{script}", line 9')
    assert lines[-1] == "ZeroDivisionError: of the script"
    assert "runpy" not in fails.stderr
    assert "tawami/" not in fails.stderr


def test_a_mistake_is_one_line(script, here):
    run = here("run", script, "--", "mistake")
    assert run.returncode == 1
    assert run.stderr == (
        "case.py: linear_elastic: E = -1: expected a positive, finite modulus in Pa; at 2 s\n"
    )


def test_the_exit_code_of_a_script_is_that_of_the_command(script, here):
    assert here("run", script, "--", "exit").returncode == 3


@pytest.mark.mpi
def test_only_the_first_of_several_ranks_prints(script, process):
    run = process("run", script, "--ranks", 2, "--resume", "--", "ranks")
    assert run.returncode == 0, run.stderr
    assert run.stdout.splitlines()[1:] == ["resume None", "ranks 2"]


def test_a_script_or_module_that_cannot_be_run_is_rejected(script, rejected, tmp_path, monkeypatch):
    assert "script 'nowhere.py' cannot be read (No such file or directory): expected" in rejected(
        "run", "nowhere.py"
    )
    (tmp_path / "empty").mkdir()
    assert "cannot be read (Is a directory): expected" in rejected("run", tmp_path / "empty")
    script.write_text("a = 1\nb = = 2\n")
    assert "case.py', line 2 is not Python: invalid syntax" in rejected("run", script)
    script.write_bytes(b"\x00\xff\x00")
    assert "is not Python" in rejected("run", script)
    script.write_text("1")
    assert "no module 'nothing.at_all' can be run" in rejected("run", "-m", "nothing.at_all")
    assert "no module 'tawami.forms' can" in rejected("run", "-m", "tawami.forms")
    assert "no module '..' can be run" in rejected("run", "-m", "..")
    monkeypatch.setenv("PATH", str(tmp_path))
    assert rejected("run", script, "--ranks", "2").endswith("apt install openmpi-bin\n")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["run"], "expected a SCRIPT, or -m with the name of a module"),
        (["run", "a.py", "-m", "b"], "arguments of the script follow --: tawami run -m b -- a.py"),
        (["run", "a.py", "--ranks", "0"], "'0': expected a whole number, at least 1"),
        (["run", "a.py", "--ranks", "two"], "'two': expected a whole number"),
        (["run", "a.py", "--resume", "--replace"], "not allowed with argument"),
        (["run", "a.py", "--log-level", "loud"], "invalid choice: 'loud'"),
        (["run", "a.py", "--n", "4"], "unrecognized arguments: --n 4"),
        (["info", "--", "a"], "arguments after -- belong to a script"),
        (["plot", "x", "--movie", "avi"], "invalid choice: 'avi'"),
        ([], "the following arguments are required: COMMAND"),
        (["dance"], "invalid choice: 'dance'"),
    ],
)
def test_wrong_arguments_are_rejected(capsys, arguments, message):
    with pytest.raises(SystemExit) as end:
        main.main(arguments)
    assert end.value.code == 2
    assert message in capsys.readouterr().err


def test_a_script_knows_its_name_and_its_command():
    script = Script(None, "cases.verification.cook", ("--n", "4"))
    assert (script.name, script.command) == (
        "cases.verification.cook",
        ["-m", "cases.verification.cook"],
    )
