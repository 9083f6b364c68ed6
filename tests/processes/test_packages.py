"""Packages that a user adds to `.venv`."""

import subprocess
import sys
import zipfile
from pathlib import Path

import numpy


def wheel(folder: Path, name: str, version: str, *requires: str) -> Path:
    """An empty package."""
    path, info = folder / f"{name}-{version}-py3-none-any.whl", f"{name}-{version}.dist-info"
    lines = [f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}"]
    lines += [f"Requires-Dist: {requirement}" for requirement in requires]
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr(f"{info}/METADATA", "\n".join(lines) + "\n")
        kind = "Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n"
        archive.writestr(f"{info}/WHEEL", kind)
        archive.writestr(f"{info}/RECORD", "")
    return path


def install(folder: Path, *packages: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "pip", "install", "--dry-run", "--no-index", "--find-links"]
    return subprocess.run(
        [*command, str(folder), *packages], capture_output=True, text=True, timeout=120, check=False
    )


def test_no_package_replaces_the_numpy_that_dolfinx_was_built_with(tmp_path):
    wheel(tmp_path, "numpy", "99.0")
    wheel(tmp_path, "greedy", "1.0", "numpy>=99")
    wheel(tmp_path, "modest", "1.0", "numpy")
    refused = install(tmp_path, "greedy")
    assert refused.returncode != 0
    assert f"numpy=={numpy.__version__}" in refused.stdout.replace(" ", "")
    upgrade = install(tmp_path, "--upgrade", "--upgrade-strategy", "eager", "modest")
    assert upgrade.returncode == 0, upgrade.stderr
    assert "numpy-99" not in upgrade.stdout
