"""The environment of a run: missing packages and compilers, pipes, BLAS, the wheel."""

from __future__ import annotations

import os
import subprocess
import sys
import sysconfig
import venv
from pathlib import Path

import pytest
from programs import PYTHONPATH, ROOT, python
from scenes import COUPLED, FINITE, FORMS

from tawami.fem import environment
from tawami.form.files import shipped


def test_a_missing_dolfinx_is_named_with_its_package():
    run = python("-c", "import sys; sys.modules['dolfinx'] = None; import tawami")
    assert run.returncode == 1
    last = run.stderr.strip().splitlines()[-1]
    assert last.startswith("tawami.base.errors.MissingDependencyError: tawami needs dolfinx")
    assert "apt install python3-dolfinx-real" in last


def test_a_missing_compiler_is_named_with_its_package(tmp_path):
    code = """
import logging, os; logging.disable(logging.INFO)
from cases.verification.cantilever import mpm
os.environ["CC"] = "no-such-compiler"
mpm.build("u", "paper", 2)
"""
    run = python("-c", code, variables={"XDG_CACHE_HOME": str(tmp_path), "CC": "no-such-compiler"})
    last = run.stderr.strip().splitlines()[-1]
    assert last.startswith(
        "tawami.base.errors.MissingDependencyError: form 'u': the C compiler failed"
    )
    assert "apt install g++ python3-dev" in last


def test_a_closed_pipe_prints_no_page_about_a_crash():
    code = "import tawami, sys; [print('x' * 200) for _ in range(9999)]"
    command = f"'{sys.executable}' -c \"{code}\" | head -n 1"
    run = subprocess.run(
        command, shell=True, cwd=ROOT, capture_output=True, text=True, check=True,
        env=os.environ | {"PYTHONPATH": PYTHONPATH},
    )  # fmt: skip
    assert "PETSC" not in run.stderr
    assert "MPI_ABORT" not in run.stderr


def test_the_header_names_versions_and_blas():
    header = environment.header()
    for word in ("tawami", "dolfinx", "PETSc", "NumPy", "BLAS", "OMP_NUM_THREADS"):
        assert word in header


def test_the_header_warns_of_the_reference_blas(monkeypatch, tmp_path):
    maps = tmp_path / "maps"
    library = tmp_path / "blas" / "libblas.so.3"
    library.parent.mkdir()
    library.touch()
    maps.write_text(f"7f00-7f01 r-xp 0 08:01 1 {library}\n")
    monkeypatch.setattr(environment, "MAPS", maps)
    assert environment.blas() == (f"reference BLAS ({library})", True)
    assert "apt install libopenblas0-serial" in environment.header()
    library.unlink()
    fast = tmp_path / "openblas-serial" / "libblas.so.3"
    fast.parent.mkdir()
    fast.touch()
    library.symlink_to(fast)
    assert environment.blas() == ("openblas-serial", False)
    assert "Warning" not in environment.header()


@pytest.fixture(scope="module")
def installed(tmp_path_factory) -> Path:
    """Python of an environment that has only the wheel and its dependencies."""
    folder = tmp_path_factory.mktemp("wheel")
    build = [sys.executable, "-m", "maturin", "build", "--release", "--locked", "--quiet"]
    # as in the Makefile, so that what was compiled there is used
    flags = os.environ | {"RUSTFLAGS": "-C target-cpu=native"}
    subprocess.run([*build, "--out", folder], cwd=ROOT, check=True, capture_output=True, env=flags)
    (wheel,) = folder.glob("tawami-*.whl")
    home = folder / "empty"
    venv.create(home, system_site_packages=True)
    executable = home / "bin" / "python"
    install = [sys.executable, "-m", "pip", "--python", executable, "install"]
    subprocess.run(
        [*install, "--quiet", "--no-deps", "--no-index", wheel], check=True, capture_output=True
    )
    (packages,) = home.glob("lib/python*/site-packages")
    (packages / "dependencies.pth").write_text(sysconfig.get_path("platlib"))
    return executable


def without_path() -> dict[str, str]:
    return {k: v for k, v in os.environ.items() if k != "PYTHONPATH"}


@pytest.mark.slow
def test_the_wheel_has_the_command_the_templates_and_the_types(installed, tmp_path):
    command, environment = installed.parent / "tawami", without_path()
    for kind in ("statics", "dynamics"):
        subprocess.run(
            [command, "new", kind, f"--{kind}"], cwd=tmp_path, env=environment, check=True
        )
        text = (tmp_path / f"{kind}.py").read_text()
        assert text == (ROOT / f"python/tawami/command/templates/{kind}.py").read_text().replace(
            "SCRIPT", kind
        )
    run = subprocess.run(
        [command, "run", "statics.py"], cwd=tmp_path, env=environment, capture_output=True, text=True,
        check=True,
    )  # fmt: skip
    assert "written to results/statics" in run.stdout
    (package,) = installed.parent.parent.glob("lib/python*/site-packages/tawami")
    assert (package / "py.typed").exists()
    assert (package / "_rust.pyi").exists()


@pytest.mark.slow
def test_every_form_runs_from_an_installed_wheel(installed, tmp_path):
    code = f"""
import logging; logging.disable(logging.INFO)
from mpi4py import MPI
import tawami
assert "empty" in tawami.__file__, tawami.__file__
for options in {[*FORMS.values(), *FINITE.values(), *COUPLED.values()]!r}:
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=0.5, cells=(4, 2))
    body = tawami.box(grid, (0, 0), (2, 1))
    scene = tawami.Scene(grid, body, tawami.linear_elastic(E=1e3, nu=0.4999), density=1.0, **options)
    scene.fix("left", "x")
    scene.fix("left", "y")
    scene.traction("right", (0.0, -1.0))
    for name in scene.form.data:
        scene.data(name, 1.0)
    print(options["form"], scene.solve(until=1.0).displacement((2, 0.5))[1] < 0)
"""
    run = subprocess.run(
        [installed, "-c", code], cwd=tmp_path, env=without_path(), capture_output=True, text=True,
        check=False,
    )  # fmt: skip
    assert run.returncode == 0, run.stderr
    lines = run.stdout.splitlines()[
        -len(FORMS) - len(FINITE) - len(COUPLED) :
    ]  # MPI may print lines before
    assert {line.split()[0] for line in lines} == set(shipped())
    assert all(line.endswith("True") for line in lines)
