"""Failures of MUMPS and PETSc that say nothing about the tangent."""

from __future__ import annotations

import numpy as np
import pytest
from petsc4py import PETSc
from programs import python
from scenes import grid_of

import tawami
from tawami.solve import direct, failures

#: Whatever solver the session names.
pytestmark = pytest.mark.direct

#: A beam whose matrix does not fit into the memory that is left, after a first small step.
LITTLE_MEMORY = """
import resource
import tawami
from scenes import grid_of

def solve(cells):
    grid = grid_of(cells)
    body = tawami.box(grid, grid.origin, grid.upper)
    scene = tawami.Scene(grid, body, tawami.linear_elastic(E=1.0, nu=0.3), form="u")
    scene.fix("left", "x")
    scene.fix("left", "y")
    scene.traction("right", (0.0, -1e-3))
    return scene

solve((2, 2)).solve()
large = solve((64, 64))
with open("/proc/self/statm") as file:
    most = int(file.read().split()[0]) * resource.getpagesize() + {room} * 2**20
resource.setrlimit(resource.RLIMIT_AS, (most, most))
tawami.run(large.solve, "large")
"""


def beam(cells: tuple[int, int], **options) -> tawami.Scene:
    grid = grid_of(cells)
    body = tawami.box(grid, grid.origin, grid.upper)
    scene = tawami.Scene(grid, body, tawami.linear_elastic(E=1.0, nu=0.3), form="u_epsv", **options)
    scene.fix("left", "x")
    scene.fix("left", "y")
    scene.traction("right", (0.0, -1e-3))
    return scene


@pytest.fixture
def one_megabyte(monkeypatch):
    """MUMPS may use 1 MB."""
    options = PETSc.Options()
    names = [f"{getattr(direct, 'PREFIX', '')}mat_mumps_icntl_23"]
    for name in names:
        options[name] = 1
    yield
    for name in names:
        options.delValue(name)


def test_mumps_without_memory_is_no_singular_tangent(one_megabyte):
    scene = beam((32, 32))
    with pytest.raises(tawami.SolverError, match=r"memory ran out \(INFOG\(1\) = -\d+") as caught:
        scene.solve()
    assert not isinstance(caught.value, tawami.SingularError)
    assert "unknowns" in str(caught.value)
    assert not scene.particles.displacement.any()
    # the advice
    assert "linear_solver='multigrid'" in str(caught.value)
    moved = beam((32, 32), linear_solver="multigrid").solve().u
    assert np.abs(moved).max() > 0


@pytest.mark.parametrize(
    "code", [-1, -2, -3, -16, *failures.MEMORY, *failures.TOO_LARGE, -53, -90, -800]
)
def test_no_failure_of_mumps_is_a_singular_tangent(code, monkeypatch):
    monkeypatch.setattr(direct.DirectSolver, "_mumps", lambda *_: (code, 7))
    with pytest.raises(tawami.SolverError, match=rf"INFOG\(1\) = {code}, INFOG\(2\) = 7") as caught:
        beam((2, 2)).solve()
    assert ("memory ran out" in str(caught.value)) == (code in failures.MEMORY)


@pytest.mark.parametrize("room", [8, pytest.param(24, marks=pytest.mark.slow)])
def test_a_process_without_memory_ends_with_one_line(room):
    run = python("-c", LITTLE_MEMORY.replace("{room}", str(room)))
    assert run.returncode == 1
    assert run.stderr.startswith("large: "), run.stderr
    assert "memory ran out" in run.stderr
    assert run.stderr.count("\n") == 1


@pytest.mark.parametrize(
    ("code", "text", "memory"),
    [(55, "Memory requested 99", True), (76, "MUMPS: INFOG(1)=-9", True), (76, "lib", False)],
)
def test_errors_of_petsc_are_errors_of_tawami(code, text, memory, monkeypatch):
    class Failed(PETSc.Error):
        def __str__(self):
            return f"error code {self.ierr}\n[0] KSPSolve()\n[0] {text}\n"

    def fail(*_):
        raise Failed(code)

    monkeypatch.setattr(direct.DirectSolver, "_solve_all", fail)
    with pytest.raises(tawami.SolverError, match="PETSc") as caught:
        beam((2, 2)).solve()
    assert ("memory ran out" in str(caught.value)) == memory
    monkeypatch.undo()
    assert np.isfinite(beam((2, 2)).solve().u).all()
