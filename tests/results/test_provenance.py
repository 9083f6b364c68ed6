"""run.json and the copies beside it: what was run, for scripts, modules and code of a session."""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
import sys
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI
from ufl import grad

import tawami
from tawami.form import vector
from tawami.form.form import Form
from tawami.results import provenance

ROOT = Path(__file__).parents[2]
SCRIPT = """
import logging; logging.disable(logging.INFO)
from mpi4py import MPI
import tawami
from tawami.results import provenance

def main():
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 1), h=0.5, cells=(4, 2))
    body = tawami.box(grid, (0, 1), (2, 2))
    scene = tawami.Scene(grid, body, tawami.linear_elastic(E=1e3, nu=0.3), form="u_epsv")
    scene.fix("left", "x")
    provenance.write("results", scene)

tawami.run(main, "driver")
"""


def started(folder: Path, *arguments: str, **variables: str) -> dict:
    """Run Python in a folder and read the run.json that it writes."""
    environment = os.environ | {"GIT_CONFIG_NOSYSTEM": "1"} | variables
    command = [sys.executable, *arguments]
    subprocess.run(command, cwd=folder, env=environment, check=True, capture_output=True)
    return json.loads((folder / "results" / "run.json").read_text())


def test_a_script_is_described(tmp_path):
    script = tmp_path / "beam.py"
    script.write_text(SCRIPT)
    before = datetime.now(UTC)
    run = started(tmp_path, "beam.py", "--cells", "4", OMP_NUM_THREADS="1")
    assert (run["script"], run["module"]) == (str(script), None)
    assert run["arguments"] == ["--cells", "4"]
    assert run["directory"] == str(tmp_path)
    assert run["script_sha256"] == hashlib.sha256(SCRIPT.encode()).hexdigest()
    assert (tmp_path / "results" / "script.py").read_text() == SCRIPT
    assert (run["ranks"], run["git"], run["phases"]) == (1, None, [])
    assert run["threads"]["OMP_NUM_THREADS"] == "1"
    assert run["grid"] == {
        "origin": [0, 1],
        "h": 0.5,
        "cells": [4, 2],
        "geometry": "plane_strain",
    }
    assert run["form"] == {"name": "u_epsv", "source": str(ROOT / "forms" / "u_epsv.py")}
    assert (tmp_path / "results" / "form.py").read_bytes() == (
        ROOT / "forms/u_epsv.py"
    ).read_bytes()
    assert run["input"][0].startswith("grid          4 x 2 cells of 0.5 m")
    assert "supports      fix('left') x" in run["input"]
    assert run["versions"]["NumPy"] == np.__version__
    assert f"BLAS {run['blas']}" in run["environment"]
    assert abs(datetime.fromisoformat(run["started"]) - before).total_seconds() < 60
    assert Path(run["python"]).samefile(sys.executable)


def test_a_module_is_described_and_code_without_a_file_is_not(tmp_path):
    package = tmp_path / "study"
    package.mkdir()
    (package / "__init__.py").touch()
    (package / "__main__.py").write_text(SCRIPT)
    run = started(tmp_path, "-m", "study", "x")
    assert (run["module"], run["script"]) == ("study", str(package / "__main__.py"))
    assert run["arguments"] == ["x"]
    (tmp_path / "results" / "script.py").unlink()
    run = started(tmp_path, "-c", SCRIPT)
    assert (run["script"], run["module"], run["script_sha256"]) == (None, None, None)
    assert not (tmp_path / "results" / "script.py").exists()


def git(folder: Path, *words: str) -> str:
    author = ["-c", "user.name=A", "-c", "user.email=a@b.c", "-c", "commit.gpgsign=false"]
    command = ["git", *author, *words]
    return subprocess.run(
        command, cwd=folder, check=True, capture_output=True, text=True
    ).stdout.strip()


def test_the_revision_of_git_is_recorded(tmp_path, monkeypatch):
    assert provenance.git(tmp_path) is None
    git(tmp_path, "init", "--quiet")
    assert provenance.git(tmp_path) is None  # without a revision
    (tmp_path / "beam.py").write_text(SCRIPT)
    git(tmp_path, "add", "beam.py")
    git(tmp_path, "commit", "--quiet", "-m", "a beam")
    revision = git(tmp_path, "rev-parse", "HEAD")
    (tmp_path / "results").mkdir()
    (tmp_path / "results" / "table.csv").write_text("results are not tracked")
    assert provenance.git(tmp_path) == {"revision": revision, "changed": False}
    (tmp_path / "beam.py").write_text(SCRIPT + "# changed\n")
    assert provenance.git(tmp_path) == {"revision": revision, "changed": True}
    monkeypatch.setenv("PATH", str(tmp_path))
    assert provenance.git(tmp_path) is None


def plain(u, w, sigma, sum_p, mu):
    """The residual of a form in this file."""
    return sum_p(sigma, grad(w))


def test_a_form_of_a_script_can_be_loaded_again(tmp_path):
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=0.5, cells=(4, 2))
    body = tawami.box(grid, (0, 0), (2, 1), per_axis=2)
    law = tawami.linear_elastic(E=1e3, nu=0.3)
    form = Form({"u": vector("w")}, plain)
    scene = tawami.Scene(grid, body, law, form=form)
    provenance.write(tmp_path, scene)
    known = json.loads((tmp_path / "run.json").read_text())["form"]
    assert known == {"name": "of the driver script", "source": __file__}
    again = tawami.Scene(grid, body, law, form=tmp_path / "form.py")
    u = np.random.default_rng(0).standard_normal(scene.num_coefficients)
    np.testing.assert_array_equal(again.residual(u), scene.residual(u))


def test_a_form_without_source_is_recorded_as_such(tmp_path):
    names: dict = {"grad": grad}
    exec("def residual(w, sigma, sum_p):\n    return sum_p(sigma, grad(w))", names)
    form = Form({"u": vector("w")}, names["residual"])
    assert provenance.source_of(form) is None
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=0.5, cells=(4, 2))
    body = tawami.box(grid, (0, 0), (2, 1), per_axis=2)
    scene = tawami.Scene(grid, body, tawami.linear_elastic(E=1e3, nu=0.3), form=form)
    provenance.write(tmp_path, scene)
    assert json.loads((tmp_path / "run.json").read_text())["form"]["source"] is None
    assert not (tmp_path / "form.py").exists()


def test_a_folder_that_cannot_be_written_is_named(tmp_path):
    (tmp_path / "file").touch()
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=0.5, cells=(4, 2))
    body = tawami.box(grid, (0, 0), (2, 1), per_axis=2)
    scene = tawami.Scene(grid, body, tawami.linear_elastic(E=1e3, nu=0.3), form="u")
    with pytest.raises(tawami.OutputError, match="result folder .* cannot be written"):
        provenance.write(tmp_path / "file" / "below", scene)
