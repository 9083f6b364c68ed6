"""`tawami resume`: what run.json says is run again, or the message says why it cannot be."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import pytest

from tawami.command.resume import Run


def described(file: Path, /, **other: object) -> dict[str, object]:
    """A run.json of this script."""
    return {
        "script": str(file), "module": None, "arguments": ["ranks"], "ranks": 1,
        "directory": str(file.parent), "python": "3", "versions": {}, "git": None,
        "script_sha256": hashlib.sha256(file.read_bytes()).hexdigest(), "phases": [], **other,
    }  # fmt: skip


@pytest.fixture
def results(script, tmp_path):
    folder = tmp_path / "results"
    folder.mkdir()
    (folder / "run.json").write_text(json.dumps(described(script)))
    (folder / "script.py").write_bytes(script.read_bytes())
    return folder


def test_a_script_is_run_again_where_it_was_run(script, results, here):
    run = here("resume", results, cwd=results.parent)
    assert run.returncode == 0, run.stderr
    line, first, environment, ranks = run.stdout.splitlines()
    assert line == (
        f"tawami resume: runs {script} ranks in '{script.parent}' on 1 rank, from the "
        f"results in '{results}'"
    )
    assert f"{[str(script), 'ranks']} {script.parent} {script.parent}" in first
    assert (environment, ranks) == ("resume None", "ranks 1")


def test_the_copy_of_a_module_is_run_with_a_remark(script, results, here):
    (results / "run.json").write_text(json.dumps(described(script, module="case", ranks=2)))
    run = Run.of(results)
    assert (run.number, run.remark) == (2, None)
    script.write_text(script.read_text() + "print('changed')")
    run = here("resume", results, "--ranks", 1)
    assert run.returncode == 0, run.stderr
    lines = run.stdout.splitlines()
    assert lines[0].startswith("tawami resume: runs -m case ranks in ")
    again = f"(cd {script.parent} && tawami run -m case --resume -- ranks)"
    assert lines[1] == (
        f"tawami resume: '{script}' has changed since; the copy in the folder is run. To resume with "
        f"the changed script: {again}"
    )
    assert lines[2].startswith(f"__main__ {script} {[str(script), 'ranks']} {script.parent}")
    assert lines[-1] == "ranks 1"
    run = here("run", "-m", "case", "--resume", "--", "ranks", cwd=script.parent)
    assert run.stdout.splitlines()[-2:] == ["ranks 1", "changed"]


def test_the_copy_runs_in_the_place_of_a_script_that_is_gone(script, results, here):
    """It imports what the script imported, and its errors show its own lines."""
    (script.parent / "beside.py").write_text("value = 3")
    script.write_text("from beside import value\nprint('here', value, __file__)\n1 / 0\n")
    (results / "script.py").write_bytes(script.read_bytes())
    (results / "run.json").write_text(json.dumps(described(script)))
    script.unlink()
    run = here("resume", results)
    assert run.stdout.splitlines()[1:] == [
        f"tawami resume: '{script}' does not exist; the copy in the folder is run",
        f"here 3 {script}",
    ]
    assert run.stderr.splitlines()[1:3] == [f'  File "{script}", line 3, in <module>', "    1 / 0"]


def test_another_script_is_run_only_if_it_is_trusted(script, results, here, rejected):
    copy = results / "script.py"
    copy.write_text("print('another')\n")
    said = rejected("resume", results)
    assert "differs from the script that started the run" in said
    assert f"tawami resume --trust {results}" in said
    run = here("resume", "--trust", results)
    assert (run.returncode, run.stdout.splitlines()[-1]) == (0, "another")
    copy.unlink()
    for options in ([], ["--trust"]):
        said = rejected("resume", *options, results)
        assert f"copy of the script '{copy}' cannot be read (No such file or directory)" in said
        assert "tawami run SCRIPT --resume" in said


@pytest.mark.mpi
def test_the_copy_runs_on_ranks(script, results, process):
    (results / "run.json").write_text(json.dumps(described(script)))
    script.write_text("print('changed')")
    run = process("resume", results, "--ranks", 2)
    assert run.returncode == 0, run.stderr
    lines = run.stdout.splitlines()
    assert lines.count("ranks 2") == 1  # the first rank prints
    assert sum("the copy in the folder is run" in line for line in lines) == 1


def test_a_run_that_cannot_be_resumed_is_rejected(rejected, script, results):
    assert "'nowhere' does not exist: expected the folder of a run" in rejected("resume", "nowhere")
    file = results / "run.json"
    for text, message in [
        ("{", "to run again (Expecting"),
        ("[]", "to run again (it holds a list)"),
        ('{"script": "a"}', "to run again (no 'module')"),
        (json.dumps(described(script, ranks="2")), "ranks is '2'"),
        (json.dumps(described(script, ranks=0)), "ranks 0"),
        (json.dumps(described(script, arguments=[1])), "arguments are [1]"),
        (json.dumps(described(script, directory=None)), "directory is None"),
        (json.dumps(described(script, script=None)), "it was an interactive session, not a script"),
        (
            json.dumps(described(script, directory="/nowhere")),
            "was started in '/nowhere', which does not exist",
        ),
    ]:
        file.write_text(text)
        said = rejected("resume", results)
        assert message in said
        assert "to run again" not in said or "tawami run SCRIPT --resume" in said
