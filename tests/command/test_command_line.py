"""The command line: runs scripts as python does, one line for a user's mistake, exit codes."""

from __future__ import annotations

import hashlib
import json
import os
import signal
import subprocess
import sys
import time
import types
from pathlib import Path

import pytest

import tawami
from tawami.command import information, launch, main

SCRIPT = """
import os, sys
def fails():
    raise ZeroDivisionError("of the script")
print(__name__, __file__, sys.argv, os.getcwd(), sys.path[0])
print(os.environ.get("TAWAMI_EXISTING"), os.environ.get("TAWAMI_LOG_LEVEL"))
what = sys.argv[1] if len(sys.argv) > 1 else ""
if what == "fails":
    fails()
if what == "exit":
    sys.exit(3)
if what == "mistake":
    import tawami
    try:
        tawami.linear_elastic(E=-1.0, nu=0.3)
    except tawami.TawamiError as error:
        error.add_note("at 2 s")
        raise
if what == "ranks":
    from mpi4py import MPI
    print("ranks", MPI.COMM_WORLD.size)
if what == "wait":
    import time
    print("waits", flush=True)
    time.sleep(60)
"""


@pytest.fixture
def script(tmp_path):
    path = tmp_path / "work" / "case.py"
    path.parent.mkdir()
    path.write_text(SCRIPT)
    return path


def command(*arguments: object, **options) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "tawami", *map(str, arguments)],
        capture_output=True, text=True, check=False, timeout=100, **options,
    )  # fmt: skip


def refused(capsys, *arguments: object) -> str:
    """The one line of a command that is not possible as given."""
    assert main.main([*map(str, arguments)]) == 2
    said = capsys.readouterr()
    assert said.err.count("\n") == 1
    return said.err


def test_help_of_everything(capsys):
    for arguments in (
        [],
        ["run"],
        ["resume"],
        ["plot"],
        ["info"],
        ["new"],
        ["form"],
        ["form", "check"],
    ):
        with pytest.raises(SystemExit) as end:
            main.main([*arguments, "--help"])
        assert end.value.code == 0
        said = capsys.readouterr().out
        assert said.startswith(" ".join(["usage: tawami", *arguments]))
        assert max(map(len, said.splitlines())) <= 100


def test_a_script_runs_as_python_runs_it(script):
    run = command("run", script.name, "--replace", "--log-level", "debug", "--", "a", "--b",
                  cwd=script.parent)  # fmt: skip
    as_python = subprocess.run(
        [sys.executable, str(script), "a", "--b"], cwd=script.parent, capture_output=True, text=True,
        check=True,
    )  # fmt: skip
    assert run.returncode == 0, run.stderr
    first, second = run.stdout.splitlines()
    assert first == as_python.stdout.splitlines()[0]
    assert second == "replace debug"


def test_a_module_runs_as_python_runs_it(script):
    again = command("run", "-m", "case", "--resume", "--", "a", cwd=script.parent)
    assert again.returncode == 0, again.stderr
    path = str(script.parent)
    assert again.stdout.splitlines() == [
        f"__main__ {script} {[str(script), 'a']} {path} {path}",
        "resume None",
    ]


def test_errors_and_exit_codes_of_a_script(script):
    fails = command("run", script, "--", "fails")
    assert fails.returncode == 1
    lines = fails.stderr.splitlines()
    assert lines[0] == "Traceback (most recent call last):"
    assert lines[1].strip().startswith(f'File "{script}", line 9')
    assert lines[-1] == "ZeroDivisionError: of the script"
    assert "runpy" not in fails.stderr
    assert "tawami/" not in fails.stderr
    assert command("run", script, "--", "exit").returncode == 3
    mistake = command("run", script, "--", "mistake")
    assert mistake.returncode == 1
    assert mistake.stderr == (
        "case.py: linear_elastic: E = -1: expected a positive, finite modulus in Pa; at 2 s\n"
    )


@pytest.mark.mpi
def test_several_ranks(script):
    run = command("run", script, "--ranks", 2, "--resume", "--", "ranks")
    assert run.returncode == 0, run.stderr
    assert run.stdout.splitlines()[1:] == ["resume None", "ranks 2"]  # of the first rank alone


@pytest.mark.parametrize("ranks", [[], ["--ranks", "2"]])
def test_ctrl_c(script, ranks):
    run = subprocess.Popen(
        [sys.executable, "-m", "tawami", "run", str(script), *ranks, "--", "wait"],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True,
    )  # fmt: skip
    assert run.stdout is not None
    while run.stdout.readline() != "waits\n":
        assert run.poll() is None
    os.killpg(run.pid, signal.SIGINT)
    _, errors = run.communicate(timeout=60)
    assert run.returncode == 130
    assert "Traceback" not in errors


def test_what_cannot_be_run(capsys, script, tmp_path, monkeypatch):
    assert "script 'nowhere.py' does not exist: expected" in refused(capsys, "run", "nowhere.py")
    assert "is a folder: expected" in refused(capsys, "run", tmp_path)
    script.write_text("a = 1\nb = = 2\n")
    assert "case.py', line 2 is not Python: invalid syntax" in refused(capsys, "run", script)
    script.write_bytes(b"\x00\xff\x00")
    assert "is not Python" in refused(capsys, "run", script)
    script.write_text("1")
    assert "no module 'nothing.at_all' can be run" in refused(capsys, "run", "-m", "nothing.at_all")
    assert "no module 'tawami.forms' can" in refused(capsys, "run", "-m", "tawami.forms")
    assert "no module '..' can be run" in refused(capsys, "run", "-m", "..")
    monkeypatch.setenv("PATH", str(tmp_path))
    said = refused(capsys, "run", script, "--ranks", "2")
    assert said.endswith("apt install openmpi-bin\n")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["run"], "one of the arguments SCRIPT -m/--module is required"),
        (["run", "a.py", "-m", "b"], "not allowed with"),
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
def test_wrong_usage(capsys, arguments, message):
    with pytest.raises(SystemExit) as end:
        main.main(arguments)
    assert end.value.code == 2
    assert message in capsys.readouterr().err


def told(of: Path, **other) -> dict:
    """A run.json."""
    return {
        "script": str(of), "module": None, "arguments": ["ranks"], "ranks": 1,
        "directory": str(of.parent), "python": "3", "versions": {}, "git": None,
        "script_sha256": hashlib.sha256(of.read_bytes()).hexdigest(), "phases": [], **other,
    }  # fmt: skip


@pytest.fixture
def results(script, tmp_path):
    folder = tmp_path / "results"
    folder.mkdir()
    (folder / "run.json").write_text(json.dumps(told(script)))
    return folder


def test_resume(script, results):
    run = command("resume", results, cwd=results.parent)
    assert run.returncode == 0, run.stderr
    line, first, environment, ranks = run.stdout.splitlines()
    assert line == (
        f"tawami resume: runs {script} ranks in '{script.parent}' on 1 rank, from where '{results}' is"
    )
    assert f"{[str(script), 'ranks']} {script.parent} {script.parent}" in first
    assert (environment, ranks) == ("resume None", "ranks 1")


def test_resume_of_a_changed_module(script, results):
    (results / "run.json").write_text(json.dumps(told(script, module="case", ranks=2)))
    assert launch.Run.of(results).number == 2
    assert not launch.Run.of(results).changed
    script.write_text(SCRIPT + "print('changed')")
    run = command("resume", results, "--ranks", 1)
    assert run.returncode == 0, run.stderr
    lines = run.stdout.splitlines()
    assert lines[0].startswith("tawami resume: runs -m case ranks in ")
    assert lines[1].startswith("tawami resume: case has changed since;")
    assert lines[-2:] == ["ranks 1", "changed"]


def test_what_cannot_be_resumed(capsys, script, results):
    assert "there is no 'nowhere/run.json': expected" in refused(capsys, "resume", "nowhere")
    file = results / "run.json"
    for text, message in [
        ("{", "is damaged (Expecting"),
        ("[]", "is damaged (it holds a list)"),
        ('{"script": "a"}', "is damaged (no 'module')"),
        (json.dumps(told(script, ranks="2")), "ranks is '2'"),
        (json.dumps(told(script, ranks=0)), "ranks 0"),
        (json.dumps(told(script, arguments=[1])), "arguments are [1]"),
        (json.dumps(told(script, directory=None)), "directory is None"),
        (json.dumps(told(script, script=None)), "it was a session, not a script"),
        (json.dumps(told(script, directory="/nowhere")), "stood in '/nowhere', which is gone"),
    ]:
        file.write_text(text)
        said = refused(capsys, "resume", results)
        assert message in said
        assert "damaged" not in said or "tawami run SCRIPT --resume" in said
    file.write_text(json.dumps(told(script)))
    script.unlink()
    assert "is gone: expected it there" in refused(capsys, "resume", results)
    (results / "script.py").touch()
    said = refused(capsys, "resume", results)
    assert f"(cd {script.parent} && tawami run {results}/script.py --resume -- ranks)" in said


def test_plot(capsys, monkeypatch):
    asked = []

    def plot(folder, *, quantity, movie):
        asked.append((folder, quantity, movie))
        if folder == "empty":
            raise tawami.InputError("'empty' holds no results")
        return [Path(folder) / "a.png", Path(folder) / "b.gif"]

    stand_in = types.ModuleType("tawami.results.plot")
    stand_in.plot = plot  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "tawami.results.plot", stand_in)
    assert main.main(["plot", "pile"]) == 0
    assert main.main(["plot", "pile", "--quantity", "velocity", "--movie", "none"]) == 0
    assert asked == [("pile", "mean stress", "gif"), ("pile", "velocity", None)]
    assert capsys.readouterr().out.splitlines()[:2] == ["pile/a.png", "pile/b.gif"]
    assert refused(capsys, "plot", "empty") == "tawami plot: 'empty' holds no results\n"


def test_info(capsys, monkeypatch, tmp_path):
    assert main.main(["info"]) == 0
    said = capsys.readouterr().out
    for word in (
        "dolfinx", "BLAS", "RAYON_NUM_THREADS", "GB", "Open MPI", "gcc", "tawami-", "matplotlib",
        "self test     ok",
    ):  # fmt: skip
        assert word in said
    monkeypatch.setattr(information, "OPTIONAL", (("no_such_package", "nothing"),))
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setenv("CC", "no-such-compiler")
    monkeypatch.setattr(information.scenes, "K", 6.0)
    exact = information.scenes.stress_of
    monkeypatch.setattr(information.scenes, "stress_of", lambda strain: 1.01 * exact(strain))
    assert main.main(["info"]) == 1
    said = " ".join(capsys.readouterr().out.split())
    for words in (
        f"missing (nothing): {sys.executable} -m pip install no_such_package",
        "missing (movies as MP4): apt install ffmpeg",
        "MISSING: 'no-such-compiler', which compiles forms: apt install g++ python3-dev",
        "no mpirun: apt install openmpi-bin",
        "self test FAILED: a block under a traction, error of its stress 9.9e-03",
    ):
        assert words in said


@pytest.mark.parametrize("kind", ["statics", "dynamics"])
def test_new(capsys, tmp_path, kind):
    path = tmp_path / "mycase.py"
    assert main.main(["new", str(tmp_path / "mycase"), f"--{kind}"]) == 0
    text = path.read_text()
    compile(text, path, "exec")
    assert "SCRIPT" not in text
    assert "`tawami run mycase.py`" in text
    path.write_text("mine")
    assert "is there already, and was not touched" in refused(capsys, "new", path)
    assert path.read_text() == "mine"
    assert "expected a name of letters" in refused(capsys, "new", tmp_path / "my-case")
    assert main.main(["new", str(tmp_path / "nowhere" / "case")]) == 1
    assert "cannot be written: No such file" in capsys.readouterr().err


def test_the_new_script_of_statics_runs(tmp_path):
    assert main.main(["new", str(tmp_path / "beam")]) == 0
    run = command("run", "beam.py", cwd=tmp_path)
    assert run.returncode == 0, run.stderr
    (tip,) = (line for line in run.stdout.splitlines() if line.startswith("tip deflection"))
    assert float(tip.split()[-1]) == pytest.approx(0.009684, rel=0.01)  # clamped: its limit
    written = {path.name for path in (tmp_path / "results" / "beam").iterdir()}
    assert written == {"particles.vtu", "grid.vtu"}


def test_a_day_with_the_new_script_of_dynamics(tmp_path):
    """Begun, stopped, refused, resumed, drawn."""
    assert main.main(["new", str(tmp_path / "slump"), "--dynamics"]) == 0
    start = [sys.executable, "-m", "tawami", "run", "slump.py"]
    process = subprocess.Popen(start, cwd=tmp_path, stderr=subprocess.PIPE, text=True)
    folder = tmp_path / "results" / "slump"
    for _ in range(600):
        if list(folder.glob("checkpoints/02-motion-*")):
            break
        time.sleep(0.1)
    process.terminate()
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 143, errors
    assert "go on with: tawami resume results/slump" in errors
    again = command("run", "slump.py", cwd=tmp_path)
    assert again.returncode == 1
    assert "the folder holds a run" in again.stderr
    resumed = command("resume", "results/slump", cwd=tmp_path)
    assert resumed.returncode == 0, resumed.stderr
    assert "run-out [m]: 0.56" in resumed.stdout
    assert "goes on" in (folder / "log.txt").read_text()
    drawn = command("plot", "results/slump", "--quantity", "plastic_strain", cwd=tmp_path)
    assert drawn.returncode == 0, drawn.stderr
    pictures = [tmp_path / line for line in drawn.stdout.splitlines()]
    assert {path.name for path in pictures} >= {
        "motion-plastic_strain.png", "motion-plastic_strain.gif", "motion-table.png"
    }  # fmt: skip
    assert all(path.stat().st_size > 1000 for path in pictures)


def test_form_check(capsys, tmp_path):
    assert main.main(["form", "check", "u_epsv", "--set", "stabilisation=projection"]) == 0
    said = capsys.readouterr().out
    assert "stabilisation = 'projection'" in said
    assert said.splitlines()[-1].startswith("it can be used")
    path = tmp_path / "my_form.py"
    path.write_text("fields = {'u': ('displacement', 'w')}\nkinematics = 'displacement'\n"
                    "def residual(w, stiffness): pass\n")  # fmt: skip
    assert main.main(["form", "check", str(path)]) == 1
    assert "FAILED    arguments" in capsys.readouterr().out
    assert "expected NAME=VALUE" in refused(capsys, "form", "check", "u", "--set", "alpha")
    assert "has no parameter 'k'" in refused(capsys, "form", "check", "u", "--set", "k=1")


def test_a_run_is_described_as_it_is_started():
    script = launch.Script(None, "cases.cook", ("--n", "4"))
    assert (script.name, script.command) == ("cases.cook", ["-m", "cases.cook"])
