"""The code in the README runs as it stands."""

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


def script_of(path: Path, *parts: str) -> str:
    """Write the first blocks of code that contain these words to a script; its name."""
    path.write_text("\n".join(next(b for b in BLOCKS if part in b) for part in parts))
    return path.name


def test_the_driver_script_prints_its_header_and_writes_files(tmp_path):
    run = python(script_of(tmp_path / "script.py", "tawami.Scene"), cwd=tmp_path, check=True)
    (header,) = re.findall(r"```text\n(.*?)```", TEXT, flags=re.DOTALL)
    assert set(header.splitlines()) <= set(run.stdout.splitlines())
    deflection = float(run.stdout.split()[-1])
    row, _ = mpm.solve("u_epsv", "clamped", 16)
    assert np.isclose(deflection, row.deflection_m, rtol=1e-9)
    assert {p.name for p in tmp_path.glob("*.vtu")} == {"particles.vtu", "grid.vtu"}


def test_the_form_is_the_shipped_one(tmp_path):
    path = tmp_path / "my_form.py"
    path.write_text(next(block for block in BLOCKS if "def residual" in block))
    mine, _ = mpm.solve(str(path), "exact", 4, 0.1)
    shipped, _ = mpm.solve("u_epsv", "exact", 4, 0.1)
    assert np.isclose(mine.deflection_m, shipped.deflection_m, rtol=1e-12)
    assert isinstance(Form.load(path), tawami.Form)


def test_the_law_in_numpy_is_linear_elasticity():
    names: dict[str, object] = {}
    exec(next(block for block in BLOCKS if "NumpyLaw" in block), names)
    rust = tawami.linear_elastic(K=names["K"], mu=names["mu"])
    u = [mpm.build("u_epsv", "clamped", 4, material=m).solve().u for m in (names["my_law"], rust)]
    assert np.allclose(u[0], u[1], rtol=0, atol=1e-9 * np.abs(u[1]).max())


def test_the_block_in_motion_keeps_its_angular_momentum_and_writes_results(tmp_path):
    name = script_of(tmp_path / "script.py", "tawami.Dynamics", "tawami.Results")
    run = python(name, cwd=tmp_path, check=True)
    folder = tmp_path / "results" / "block"
    assert {path.name for path in folder.glob("[!.]*")} == {
        "checkpoints", "form.py", "log.txt", "motion", "run.json", "script.py"
    }  # fmt: skip
    assert len(list((folder / "motion" / "particles").glob("*.vtu"))) == 11
    (printed,) = re.findall(r"^angular momentum.*?(\S+)$", run.stdout, flags=re.MULTILINE)
    n = 12  # particles along a side
    x = (np.arange(n) + 0.5) / (2 * n) - 0.25
    size = 1000.0 / (2 * n) ** 2  # kg per metre depth of a particle
    assert float(printed) == pytest.approx(3.0 * size * 2 * n * (x**2).sum(), rel=5e-3)


@pytest.mark.slow
def test_the_study_recommends_the_coarse_grid(tmp_path):
    run = python(script_of(tmp_path / "study.py", "tawami.Study"), cwd=tmp_path, check=True)
    assert "Accuracy is bought by n 4 to 8" in run.stdout
    # the code's own number, as README prints it
    assert run.stdout.splitlines()[-1].startswith("MPM: n 8, alpha 0.01: errors deflection 0.0061")
