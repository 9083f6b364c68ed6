"""The other commands of `tawami`: help, new, plot, info, form check."""

from __future__ import annotations

import importlib.util
import shlex
import sys
import types
from pathlib import Path

import pytest

import tawami
from tawami.base.program import AS_ROOT
from tawami.command import information, main


def test_every_command_has_its_help(capsys):
    for arguments in (
        [], ["run"], ["resume"], ["plot"], ["info"], ["new"], ["form"], ["form", "check"],
    ):  # fmt: skip
        with pytest.raises(SystemExit) as end:
            main.main([*arguments, "--help"])
        assert end.value.code == 0
        said = capsys.readouterr().out
        assert said.startswith(" ".join(["usage: tawami", *arguments]))
        assert max(map(len, said.splitlines())) <= 100


def test_plot_passes_its_options_on(capsys, rejected, monkeypatch, tmp_path):
    asked = []

    def plot(folder, *, quantity, movie):
        asked.append((str(folder), quantity, movie))
        if str(folder) == "empty":
            raise tawami.InputError("'empty' holds no results")
        return [Path(folder) / "a.png", Path(folder) / "b.gif"]

    monkeypatch.chdir(tmp_path)
    for name in ("pile", "empty"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "run.json").touch()

    fake = types.ModuleType("tawami.results.plot")
    fake.plot = plot  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "tawami.results.plot", fake)
    assert main.main(["plot", "pile"]) == 0
    assert main.main(["plot", "pile", "--quantity", "velocity", "--movie", "none"]) == 0
    assert asked == [("pile", None, "gif"), ("pile", "velocity", None)]
    assert capsys.readouterr().out.splitlines()[:2] == ["pile/a.png", "pile/b.gif"]
    assert rejected("plot", "empty") == "tawami plot: 'empty' holds no results\n"


def test_info_lists_what_is_installed_and_what_is_missing(capsys, monkeypatch, tmp_path):
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
    exact = information.scenes.stress_of
    monkeypatch.setattr(information.scenes, "stress_of", lambda *given: 1.01 * exact(*given))
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


def test_info_lists_the_variables_that_mpirun_needs_as_root(monkeypatch):
    monkeypatch.setattr(information.os, "geteuid", lambda: 0)
    for name in AS_ROOT:
        monkeypatch.delenv(name, raising=False)
    text = dict(information.lines())["ranks"]
    assert f"As root, mpirun needs: export {AS_ROOT[0]}=1 {AS_ROOT[1]}=1" in text
    for name in AS_ROOT:
        monkeypatch.setenv(name, "1")
    assert "As root" not in dict(information.lines())["ranks"]
    monkeypatch.setattr(information.os, "geteuid", lambda: 1000)
    monkeypatch.delenv(AS_ROOT[0])
    assert "As root" not in dict(information.lines())["ranks"]


@pytest.mark.parametrize("kind", ["statics", "dynamics"])
def test_new_writes_a_script_but_not_over_another(capsys, rejected, tmp_path, kind):
    path = tmp_path / "mycase.py"
    assert main.main(["new", str(tmp_path / "mycase"), f"--{kind}"]) == 0
    text = path.read_text()
    compile(text, path, "exec")
    assert "SCRIPT" not in text
    assert "`tawami run mycase.py`" in text
    path.write_text("mine")
    assert "exists already, and was not changed" in rejected("new", path)
    assert path.read_text() == "mine"
    assert main.main(["new", str(tmp_path / "new" / "folder" / "case")]) == 0
    assert (tmp_path / "new" / "folder" / "case.py").is_file()
    assert main.main(["new", str(path / "case")]) == 1  # below a file
    assert "cannot be written: " in capsys.readouterr().err


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("my-case", "'my-case' is not a valid name in Python"),
        ("my.case", "'my.case' is not a valid name in Python"),
        ("2cases", "'2cases' is not a valid name in Python"),
        ("my case.py", "'my case' is not a valid name in Python"),
        ("class", "'class' is a keyword of Python"),
        ("None.py", "'None' is a keyword of Python"),
        ("__init__", "'__init__' is reserved by Python"),
        ("numpy", "the module 'numpy' is installed"),
        ("tawami.py", "the module 'tawami' is installed"),
        ("random", "the module 'random' is installed"),
        ("sys", "the module 'sys' is installed"),
    ],
)
def test_new_rejects_a_name_that_python_cannot_import(
    rejected, monkeypatch, tmp_path, name, message
):
    monkeypatch.chdir(tmp_path)
    said = rejected("new", name)
    assert f"tawami new: '{name}': {message}: expected another name of letters" in said
    assert "as mycase" in said
    assert not list(tmp_path.iterdir())


def test_new_writes_a_script_that_python_imports(here, tmp_path):
    (tmp_path / "mycase.py").touch()
    folder = tmp_path / "my folder"
    folder.mkdir()
    for name in ("match", "mycase", "_case", "case.py"):  # words that are keywords in places only
        written = here("new", folder / name, cwd=tmp_path)
        assert written.returncode == 0, written.stderr
        run_it = written.stdout.partition("run it with: ")[2]
        assert shlex.split(run_it) == ["tawami", "run", str((folder / name).with_suffix(".py"))]
        spec = importlib.util.spec_from_file_location(name, (folder / name).with_suffix(".py"))
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        assert callable(module.main)


def test_the_new_script_of_statics_runs(here, tmp_path):
    assert main.main(["new", str(tmp_path / "beam")]) == 0
    run = here("run", "beam.py", cwd=tmp_path)
    assert run.returncode == 0, run.stderr
    (tip,) = (line for line in run.stdout.splitlines() if line.startswith("tip deflection"))
    # the limit of finite elements for the clamped beam, cases/cantilever/report.md
    assert float(tip.split()[-1]) == pytest.approx(0.009684, rel=0.01)
    written = {path.name for path in (tmp_path / "results" / "beam" / "ramp").iterdir()}
    assert written == {"particles", "particles.pvd", "grid", "grid.pvd", "table.csv"}
    drawn = here("plot", "results/beam", "--movie", "none", cwd=tmp_path)
    assert drawn.returncode == 0, drawn.stderr
    assert [(tmp_path / line).name for line in drawn.stdout.splitlines()] == [
        "ramp-mean-stress.png", "ramp-table.png"
    ]  # fmt: skip
    again = here("run", "beam.py", cwd=tmp_path)
    assert (again.returncode, again.stdout) == (0, run.stdout)
    finished = here("run", "beam.py", "--resume", cwd=tmp_path)
    assert finished.returncode == 0, finished.stderr
    assert "tip deflection" not in finished.stdout
    assert "no effect" not in finished.stderr


#: Ends the new script of dynamics in its sixtieth step, after the checkpoint of the fiftieth.
STOP = """
    def stop(_):
        if motion.steps == 60 and "STOP" in os.environ:
            signal.raise_signal(signal.SIGTERM)
"""


def test_the_new_script_of_dynamics_is_stopped_resumed_and_drawn(here, process, tmp_path):
    assert main.main(["new", str(tmp_path / "slump"), "--dynamics"]) == 0
    path, run = tmp_path / "slump.py", "motion.run(end=END, dt=STEP, results=results)"
    text = path.read_text()
    assert text.count(run) == text.count("    print(motion.header())\n") == 1
    text = text.replace(run, run.replace("results=results", "results=results, each=stop"))
    text = text.replace("    print(motion.header())\n", f"    print(motion.header())\n{STOP}")
    path.write_text(text.replace("import tawami\n", "import os, signal\nimport tawami\n", 1))
    stopped = process("run", "slump.py", cwd=tmp_path, variables={"STOP": "1"})
    assert stopped.returncode == 143, stopped.stderr
    assert "resume it with: tawami resume results/slump" in stopped.stderr
    again = here("run", "slump.py", cwd=tmp_path)
    assert again.returncode == 1
    assert "the folder holds a run" in again.stderr
    resumed = here("resume", "results/slump", cwd=tmp_path)
    assert resumed.returncode == 0, resumed.stderr
    # the code's own number: the script printed 0.55 when it was written
    assert "run-out [m]: 0.55" in resumed.stdout
    folder = tmp_path / "results" / "slump"
    assert "resumes at" in (folder / "log.txt").read_text()
    drawn = here("plot", "results/slump", "--quantity", "plastic_strain", cwd=tmp_path)
    assert drawn.returncode == 0, drawn.stderr
    pictures = [tmp_path / line for line in drawn.stdout.splitlines()]
    assert {path.name for path in pictures} >= {
        "motion-plastic_strain.png", "motion-plastic_strain.gif", "motion-table.png"
    }  # fmt: skip
    assert all(path.stat().st_size > 1000 for path in pictures)


@pytest.mark.slow
@pytest.mark.mpi
@pytest.mark.parametrize("kind", ["--statics", "--dynamics"])
def test_the_commands_of_the_readme_work_in_turn_on_four_ranks(process, tmp_path, kind):
    """Two of the four ranks of the slump have no particles at the start."""
    for command in (
        ["new", "mycase", kind], ["run", "mycase.py", "--ranks", "4"],
        ["resume", "results/mycase", "--ranks", "4"], ["plot", "results/mycase"],
    ):  # fmt: skip
        run = process(*command, cwd=tmp_path)
        assert run.returncode == 0, run.stderr
    figures = {path.name for path in (tmp_path / "results" / "mycase" / "figures").iterdir()}
    phases = ["ramp"] if kind == "--statics" else ["ramp", "motion"]
    kinds = ("mean-stress.png", "mean-stress.gif", "table.png")
    assert figures == {f"{phase}-{what}" for phase in phases for what in kinds}


def test_form_check_prints_its_report(capsys, rejected, tmp_path):
    assert main.main(["form", "check", "u_epsv", "--set", "stabilisation=projection"]) == 0
    said = capsys.readouterr().out
    assert "stabilisation = 'projection'" in said
    assert said.splitlines()[-1].startswith("it can be used")
    path = tmp_path / "my_form.py"
    path.write_text("from tawami.form import vector\nfields = {'u': vector('w')}\n"
                    "def residual(w, stiffness): pass\n")  # fmt: skip
    assert main.main(["form", "check", str(path)]) == 1
    assert "broken    arguments" in capsys.readouterr().out
    assert "expected NAME=VALUE" in rejected("form", "check", "u", "--set", "alpha")
    assert "has no parameter 'k'" in rejected("form", "check", "u", "--set", "k=1")
