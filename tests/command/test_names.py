"""Names on the command line that are nearly right: the message suggests the right one, which works."""

from __future__ import annotations

import re
import shlex

import pytest
from scenes import grid_of

import tawami
from tawami.command.folders import run_folder


@pytest.fixture
def place(tmp_path, monkeypatch):
    """A folder with a script, a module and two runs."""
    for file in (
        "mycase.py", "package/__init__.py", "package/case.py", "results/mycase/run.json",
        "results/mycase/motion/particles.pvd", "results/mycase/motion/particles/1.vtu",
        "results/study/fine/run.json", "other/notes.txt",
    ):  # fmt: skip
        (tmp_path / file).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / file).touch()
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize(
    ("arguments", "meant"),
    [
        (["run", "mycas.py"], "mycase.py"),
        (["run", "mycase"], "mycase.py"),
        (["run", "packag/cas.py"], "package/case.py"),
        (["run", "-m", "package.cas"], "package.case"),
        (["resume", "results/mycas"], "results/mycase"),
        (["resume", "result/mycas"], "results/mycase"),
        (["plot", "mycase"], "results/mycase"),
        (["plot", "mycase.py"], "results/mycase"),
        (["form", "check", "u_epsvv"], "u_epsv"),
        (["form", "check", "mycas.py"], "mycase.py"),
        (["form", "check", "mycase"], "mycase.py"),
    ],
)
def test_a_name_that_is_nearly_right_is_suggested(rejected, place, arguments, meant):
    assert rejected(*arguments).endswith(f"; did you mean '{meant}'?\n")


@pytest.mark.parametrize("name", ["quite_different", "", "/nowhere/at/all", "x/y/z"])
def test_a_name_that_is_like_none_has_no_suggestion(rejected, place, name):
    for command in (["run"], ["plot"], ["resume"], ["form", "check"]):
        assert "did you mean" not in rejected(*command, name)


def test_a_choice_that_is_nearly_right_is_suggested():
    grid = grid_of((2, 2))
    body = tawami.box(grid, grid.origin, grid.upper)
    scene = tawami.Scene(grid, body, tawami.linear_elastic(E=1.0, nu=0.3))
    with pytest.raises(tawami.InputError, match=r"no part 'bottm', .*did you mean 'bottom'\?$"):
        scene.fix("bottm", "y")


def test_a_file_or_folder_of_a_run_names_the_run(place):
    for name in (
        ".", "run.json", "motion", "motion/particles.pvd", "motion/particles/1.vtu",
    ):  # fmt: skip
        assert run_folder(f"results/mycase/{name}").resolve() == place / "results" / "mycase"
        absolute = run_folder(str(place / "results" / "mycase" / name))
        assert absolute == place / "results" / "mycase"


def test_a_folder_with_several_runs_lists_them(rejected, place):
    assert rejected("plot", "results") == (
        "tawami plot: 'results' holds 2 runs: expected one of results/mycase, results/study/fine\n"
    )
    assert rejected("resume", "results/study") == (
        "tawami resume: 'results/study' holds a run: expected results/study/fine\n"
    )


def test_what_belongs_to_no_run_is_rejected(rejected, place):
    assert "'other/notes.txt' is not a file of a run: expected the folder of a run" in rejected(
        "plot", "other/notes.txt"
    )
    assert "'other' holds no run: expected" in rejected("plot", "other")
    said = rejected("run", "results/mycase")
    assert said.endswith("to resume the run: tawami resume results/mycase\n")


@pytest.mark.parametrize(
    ("given", "advice"),
    [
        ("run case.py --n 3", "tawami run case.py -- --n 3"),
        ("run case.py a b", "tawami run case.py -- a b"),
        ("run case.py --ranks 1 --n=3 --resume", "tawami run case.py --ranks 1 --resume -- --n=3"),
        ("run --n 3 case.py", "tawami run case.py -- --n 3"),
        ("run -m case --log-level info -n 3", "tawami run -m case --log-level info -- -n 3"),
    ],
)
def test_options_of_the_script_follow_two_dashes(script, here, given, advice):
    """And the advice works: the script receives its arguments."""
    wrong = here(*shlex.split(given), cwd=script.parent)
    assert wrong.returncode == 2
    (typed,) = re.findall(r"arguments of the script follow --: (.*)\n", wrong.stderr)
    assert typed == advice
    run = here(*shlex.split(typed)[1:], cwd=script.parent)
    assert run.returncode == 0, run.stderr
    assert str(shlex.split(typed.partition(" -- ")[2])).strip("[]") in run.stdout


def test_an_option_that_is_nearly_right_is_suggested(here):
    for command, meant in (("run a.py --rank 4", "--ranks"), ("plot a --quality v", "--quantity")):
        run = here(*command.split())
        assert run.returncode == 2
        assert f"; did you mean '{meant}'?" in run.stderr
    assert "to run a script: tawami run a.py" in here("a.py").stderr
