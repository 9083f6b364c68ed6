"""Packages that a user adds to `.venv`, and tawami as a package in another environment."""

import os
import re
import shlex
import shutil
import subprocess
import sys
import sysconfig
import zipfile
from pathlib import Path

import numpy
import pytest
from programs import ROOT


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


@pytest.mark.slow
def test_the_source_distribution_installs_and_runs_outside_the_repository(tmp_path):
    """sdist -> `pip install .` -> the programs of README and the command, in a fresh environment."""
    packages = sysconfig.get_path("purelib")
    target = os.environ.get("CARGO_TARGET_DIR", str(ROOT / "target"))
    variables = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "VIRTUAL_ENV")}
    variables |= {
        "CARGO_TARGET_DIR": target,
        "PATH": os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]]),
        "XDG_CACHE_HOME": str(tmp_path / "cache"),
    }

    def run(*words: object, cwd: Path = tmp_path) -> str:
        done = subprocess.run(
            [*map(str, words)], cwd=cwd, env=variables, capture_output=True, text=True, timeout=1800,
            check=False,
        )  # fmt: skip
        assert done.returncode == 0, f"{words}: {done.stdout}{done.stderr}"
        return done.stdout

    run("maturin", "sdist", "--manifest-path", ROOT / "Cargo.toml", "--out", tmp_path)
    (archive,) = tmp_path.glob("tawami-*.tar.gz")
    run("tar", "xzf", archive)
    source = tmp_path / archive.name.removesuffix(".tar.gz")
    home = tmp_path / "environment"
    run("/usr/bin/python3", "-m", "venv", "--system-site-packages", home)
    (own,) = home.glob("lib/python*/site-packages")
    # after the environment's own packages: those that pip would download, and maturin
    (own / "others.pth").write_text(packages + "\n")
    python = home / "bin" / "python"
    run(python, "-m", "pip", "install", "--no-build-isolation", "--no-deps", ".", cwd=source)
    shutil.rmtree(source)

    work = tmp_path / "work"
    work.mkdir()
    found = run(python, "-c", "import tawami; print(tawami.__file__)", cwd=work)
    assert Path(found.strip()).is_relative_to(home)
    for number, block in enumerate(readme("python")):
        (work / f"block_{number}.py").write_text(block)
        run(python, f"block_{number}.py", cwd=work)
    (typed,) = (block for block in readme("sh") if "tawami new" in block)
    for line in typed.splitlines():
        program, *words = shlex.split(line, comments=True)
        run(home / "bin" / program, *words, cwd=work)
    run(home / "bin" / "tawami", "form", "check", "block_1.py", cwd=work)


def readme(language: str) -> list[str]:
    """The blocks of code of README.md in a language."""
    text = (ROOT / "README.md").read_text()
    return re.findall(rf"```{language}\n(.*?)```", text, flags=re.DOTALL)


def test_examples_need_nothing_of_the_repository():
    """Pages about the measurements in the repository are an exception."""
    about_cases = {"extremes.md", "trade.md"}
    pages = [
        page for page in (ROOT / "python" / "docs").glob("*.md") if page.name not in about_cases
    ]
    code = re.compile(r"```(?:python|\{code-cell\})\n(.*?)```", re.DOTALL)
    for page in [ROOT / "README.md", *pages]:
        for block in code.findall(page.read_text()):
            imported = re.findall(r"^\s*(?:from|import) (\w+)", block, flags=re.MULTILINE)
            assert not {"cases", "tests", "programs", "scenes"} & set(imported), page.name
