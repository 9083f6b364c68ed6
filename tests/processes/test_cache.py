"""The cache of compiled forms: interrupted compilations, damaged files, several ranks."""

from __future__ import annotations

import os
import signal
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import ufl
from mpi4py import MPI
from programs import on_ranks, python

import tawami
from tawami.base.lock import hold
from tawami.fem import cache, dolfinx, kernels


def integral() -> Any:
    """A small form, the same in every process."""
    domain = dolfinx.domain()
    space = ufl.FunctionSpace(domain, dolfinx.lagrange(1))
    v = ufl.TestFunction(space)
    return 3.0 * v * ufl.dx(domain=domain, metadata={"quadrature_degree": 2})


def value(comm: Any = MPI.COMM_SELF) -> float:
    """Integral of the form over a square of side 2, by its compiled code."""
    kernel = kernels.compile_kernel(comm, integral())
    ffi = kernel.module.ffi
    b, x = np.zeros(4), np.array([[0, 0, 0], [0, 2, 0], [2, 0, 0], [2, 2, 0]], dtype=float)
    point = [ffi.cast("double *", ffi.from_buffer(array)) for array in (b, x)]
    call = ffi.cast(
        "void (*)(double*, double*, double*, double*, int*, unsigned char*)", kernel.address
    )
    call(point[0], ffi.NULL, ffi.NULL, point[1], ffi.NULL, ffi.NULL)
    return float(b.sum())


@pytest.fixture
def home(tmp_path, monkeypatch) -> Path:
    """An empty cache, where a program with XDG_CACHE_HOME = tmp_path has its own."""
    home = tmp_path / "fenics" / cache.cache_directory().name
    monkeypatch.setattr(cache, "cache_directory", lambda: home)
    return home


def code_in(home: Path) -> Path:
    (code,) = home.glob("*/code")
    return code


INTERRUPTED = "from processes.test_cache import value; value()"


@pytest.mark.parametrize(
    "sent",
    [
        signal.SIGKILL,
        *(pytest.param(s, marks=pytest.mark.slow) for s in (signal.SIGTERM, signal.SIGINT)),
    ],
)
def test_an_interrupted_compilation_needs_no_repair(sent, home, tmp_path):
    compiler = tmp_path / "compiler"
    compiler.write_text(f"#!/bin/sh\nkill -{int(sent)} $PPID\nsleep 0.2\nexit 1\n")
    compiler.chmod(0o755)
    run = python(
        "-c", INTERRUPTED, variables={"XDG_CACHE_HOME": str(tmp_path), "CC": str(compiler)}
    )
    assert run.returncode in (-sent, 1), run.stderr
    if sent != signal.SIGINT:  # Python cleans up
        (left,) = home.glob("*/code-*")
        assert list(left.glob("*.c"))
    assert not list(home.glob("*/code"))
    assert value() == pytest.approx(12.0, rel=1e-14)
    assert sorted(p.name for p in code_in(home).parent.glob("code*")) == ["code"]


def test_a_file_that_has_changed_is_compiled_again(home):
    value()
    code = code_in(home)
    (library,) = code.glob("*.so")
    for path in code.iterdir():  # this process has loaded the library: it must not change in place
        whole = path.read_bytes()
        path.unlink()
        path.write_bytes(whole)
    files = sorted(code.iterdir())
    original = library.read_bytes()
    assert cache.intact(code)
    for path in files:
        whole = path.read_bytes()
        for place in np.linspace(0, len(whole) - 1, 5, dtype=int):
            path.write_bytes(whole[:place] + bytes([whole[place] ^ 1]) + whole[place + 1 :])
            assert not cache.intact(code)
        path.write_bytes(whole[:-1])
        assert not cache.intact(code)
        path.unlink()
        assert not cache.intact(code)
        path.write_bytes(whole)
        assert cache.intact(code)
    inode = library.stat().st_ino
    value()
    assert library.stat().st_ino == inode  # an intact one is loaded as it is
    library.unlink()
    library.write_bytes(b"x" + original[1:])
    assert value() == pytest.approx(12.0, rel=1e-14)
    assert library.read_bytes() == original
    # as a process leaves it that was killed between two files
    for path in files:
        if path.suffix != ".c":
            path.unlink()
    assert value() == pytest.approx(12.0, rel=1e-14)
    assert cache.intact(code)


def test_an_intact_cache_needs_no_permission_to_write(home, monkeypatch):
    value()

    def fail(*_: Any, **__: Any) -> None:
        raise PermissionError

    monkeypatch.setattr(cache.lock, "hold", fail)
    monkeypatch.setattr(Path, "write_text", fail)
    assert value() == pytest.approx(12.0, rel=1e-14)
    code = code_in(home)
    (code / cache.CHECKSUM).unlink()
    with pytest.raises(tawami.OutputError, match="XDG_CACHE_HOME"):
        value()


HOLDING = """
import sys
from pathlib import Path
from tawami.base import lock
from tawami.fem import cache
from processes import test_cache
cache.PATIENCE = 0.2
cache.cache_directory = lambda: Path(sys.argv[1])
test_cache.value()
"""


def test_another_process_that_compiles_is_named(home):
    value()
    code = code_in(home)
    (code / cache.CHECKSUM).unlink()
    held = hold(code.parent, "the test")
    try:
        run = python("-c", HOLDING, home)
    finally:
        held.release()
    assert f"process {os.getpid()} on host" in run.stderr.splitlines()[-1]
    assert str(home) in run.stderr.splitlines()[-1]


ON_RANKS = """
from mpi4py import MPI
from tawami.fem import cache
from processes.test_cache import value
comm, calls = MPI.COMM_WORLD, []
replace = cache._replace
def counted(code, compile_into):
    calls.append(code)
    replace(code, compile_into)
cache._replace = counted
for damaged in (False, True):
    if damaged and comm.rank == 0:
        (calls[0] / cache.CHECKSUM).write_text("x")
    comm.Barrier()
    answer = round(value(comm), 12)
    found = comm.gather((len(calls), answer))
    if comm.rank == 0:
        print(found)
"""


@pytest.mark.mpi
def test_one_rank_compiles_while_the_others_wait(tmp_path):
    run = on_ranks(2, "-c", ON_RANKS, XDG_CACHE_HOME=str(tmp_path))
    assert run.stdout.splitlines() == [
        "[(1, 12.0), (0, 12.0)]", "[(2, 12.0), (0, 12.0)]"], run.stderr  # fmt: skip
