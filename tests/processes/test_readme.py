"""The code in the README runs as it stands."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import tawami
from cases.verification.cantilever import mpm
from tawami.form.form import Form

TEXT = (Path(__file__).parents[2] / "README.md").read_text()
BLOCKS = re.findall(r"```python\n(.*?)```", TEXT, flags=re.DOTALL)


def test_the_driver_script_runs(tmp_path):
    script = tmp_path / "script.py"
    script.write_text(next(block for block in BLOCKS if "tawami.Scene" in block))
    run = subprocess.run(
        [sys.executable, script.name], cwd=tmp_path, capture_output=True, text=True, check=True
    )
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


def test_the_block_in_motion_leaves_its_results(tmp_path):
    blocks = (
        next(b for b in BLOCKS if name in b) for name in ("tawami.Dynamics", "tawami.Results")
    )
    (tmp_path / "script.py").write_text("\n".join(blocks))
    subprocess.run([sys.executable, "script.py"], cwd=tmp_path, capture_output=True, check=True)
    folder = tmp_path / "results" / "block"
    assert {path.name for path in folder.iterdir()} == {
        "checkpoints", "form.py", "log.txt", "motion", "run.json", "script.py"
    }  # fmt: skip
    assert len(list((folder / "motion" / "particles").glob("*.vtu"))) == 11


def test_the_block_in_motion_keeps_its_angular_momentum(tmp_path):
    script = tmp_path / "script.py"
    script.write_text(next(block for block in BLOCKS if "tawami.Dynamics" in block))
    run = subprocess.run(
        [sys.executable, script.name], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    x = (np.arange(8) + 0.5) / 16 - 0.25
    size = 1000.0 / 16**2  # kg per metre depth of a particle
    assert float(run.stdout.split()[-1]) == pytest.approx(
        3.0 * size * 2 * 8 * (x**2).sum(), rel=5e-3
    )


def test_the_study_recommends_the_coarse_grid(tmp_path):
    script = tmp_path / "study.py"
    script.write_text(next(block for block in BLOCKS if "tawami.Study" in block))
    root = str(Path(__file__).parents[2])
    run = subprocess.run(
        [sys.executable, script.name], cwd=tmp_path, capture_output=True, text=True, check=True,
        env=os.environ | {"PYTHONPATH": root},
    )  # fmt: skip
    assert "Accuracy is bought by n 4 to 8" in run.stdout
    assert run.stdout.splitlines()[-1].startswith("MPM: n 8, alpha 0.01: errors deflection 0.0061")
