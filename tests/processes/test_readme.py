"""The examples of README.md work without changes."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from programs import ROOT, python

import tawami
from cases.verification.cantilever import mpm
from tawami.form.form import Form

TEXT = (ROOT / "README.md").read_text()
BLOCKS = re.findall(r"```python\n(.*?)```", TEXT, flags=re.DOTALL)


def test_the_script_prints_the_number_that_the_readme_states(tmp_path):
    path = tmp_path / "script.py"
    path.write_text(next(block for block in BLOCKS if "tawami.Scene" in block))
    run = python(path.name, cwd=tmp_path, check=True)
    (stated,) = re.findall(r"It prints (\S+) m\b", TEXT)
    deflection = float(run.stdout.split()[-1])
    assert deflection == pytest.approx(float(stated), abs=0.5 * 10.0 ** -len(stated.split(".")[1]))
    row, _ = mpm.solve("u_epsv", "clamped", 16, per_axis=3)
    assert np.isclose(deflection, row.deflection_m, rtol=1e-9)


def test_the_form_is_the_shipped_one(tmp_path):
    path = tmp_path / "my_form.py"
    path.write_text(next(block for block in BLOCKS if "def residual" in block))
    mine, _ = mpm.solve(str(path), "exact", 4, 0.1)
    shipped, _ = mpm.solve("u_epsv", "exact", 4, 0.1)
    assert np.isclose(mine.deflection_m, shipped.deflection_m, rtol=1e-12)
    assert isinstance(Form.load(path), tawami.Form)


@pytest.mark.slow
def test_the_commands_work_when_typed_line_by_line(tmp_path):
    (typed,) = (b for b in re.findall(r"```sh\n(.*?)```", TEXT, flags=re.DOTALL) if "tawami" in b)
    commands = [line.split("#")[0].split() for line in typed.splitlines()]
    assert len(commands) >= 5
    for program, *arguments in commands:
        assert program == "tawami"
        run = python("-m", "tawami", *arguments, cwd=tmp_path)
        assert run.returncode == 0, f"{arguments}: {run.stdout}{run.stderr}"


def test_links_lead_to_files():
    links = re.findall(r"\]\(([^)]+)\)", TEXT)
    assert len(links) > 20
    missing = [link for link in links if not (ROOT / Path(link)).exists()]
    assert not missing


def test_a_stranger_can_finish_it():
    """Some 150 lines, of which none is wider than a screen, but for tables."""
    lines = TEXT.splitlines()
    assert len(lines) <= 150
    assert max(len(line) for line in lines if not line.startswith("|")) <= 140
