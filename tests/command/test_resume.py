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


def test_a_changed_module_is_run_with_a_remark(script, results, here):
    (results / "run.json").write_text(json.dumps(described(script, module="case", ranks=2)))
    assert Run.of(results).number == 2
    assert not Run.of(results).changed
    script.write_text(script.read_text() + "print('changed')")
    run = here("resume", results, "--ranks", 1)
    assert run.returncode == 0, run.stderr
    lines = run.stdout.splitlines()
    assert lines[0].startswith("tawami resume: runs -m case ranks in ")
    assert lines[1].startswith("tawami resume: case has changed since;")
    assert lines[-2:] == ["ranks 1", "changed"]


def test_a_run_that_cannot_be_resumed_is_rejected(rejected, script, results):
    assert "'nowhere/run.json' cannot be read (No such file or directory): expected" in rejected(
        "resume", "nowhere"
    )
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
    file.write_text(json.dumps(described(script)))
    script.unlink()
    assert "does not exist: expected it there" in rejected("resume", results)
    (results / "script.py").touch()
    said = rejected("resume", results)
    assert f"(cd {script.parent} && tawami run {results}/script.py --resume -- ranks)" in said
