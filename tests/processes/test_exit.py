"""sys.exit on one of several ranks: no rank waits forever, and one message names the rank."""

from __future__ import annotations

import pytest
from programs import on_ranks

pytestmark = pytest.mark.mpi

#: A program with sys.exit at a place; the grace is short, so that the test is.
PROGRAM = """
import sys
import numpy as np
from mpi4py import MPI
import tawami
from tawami.base import program
program.GRACE = 0.5
rank = MPI.COMM_WORLD.rank

def end(place):
    if place == {place!r} and {who}:
        sys.exit({code!r})

def respond(strain, stress):
    end("law")
    return stress + strain, np.broadcast_to(np.eye(4), (len(strain), 4, 4))

def main():
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=0.5, cells=(4, 2))
    body = tawami.box(grid, (0, 0), (2, 1))
    scene = tawami.Scene(grid, body, tawami.NumpyLaw(respond, K=1.0, mu=1.0), form="u")
    scene.fix("left", "x")
    scene.fix("left", "y")
    scene.traction("right", (0.0, -1e-3))
    tawami.ramp(scene, 0.5, each=lambda _: end("each"))
    end("run")
    scene.solve()

{start}
"""
PLAIN, DRIVER = "main()", 'tawami.run(main, "driver")'


def ended(place: str, code: object, who: str = "rank == 1", start: str = PLAIN):
    return on_ranks(2, "-c", PROGRAM.format(place=place, code=code, who=who, start=start))


@pytest.mark.parametrize(
    ("place", "code", "start"),
    [
        ("each", None, PLAIN),
        pytest.param("each", 3, PLAIN, marks=pytest.mark.slow),
        pytest.param("each", "the reason", PLAIN, marks=pytest.mark.slow),
        pytest.param("run", 0, DRIVER, marks=pytest.mark.slow),
        pytest.param("run", 3, DRIVER, marks=pytest.mark.slow),
    ],
)
def test_sys_exit_on_one_rank_ends_all_and_names_the_rank(place, code, start):
    run = ended(place, code, start=start)
    assert run.returncode == (code if code == 3 else 1), run.stderr
    assert run.stderr.count(f"sys.exit({code!r}) was called on rank 1 and not on all") == 1


@pytest.mark.parametrize("code", ["the reason", pytest.param(0, marks=pytest.mark.slow)])
def test_sys_exit_in_a_law_on_one_rank_is_raised_on_all(code):
    run = ended("law", code)
    assert run.returncode == (1 if code else 0), run.stderr
    assert run.stderr.count("the reason") == (1 if code else 0), run.stderr
    assert "was called on rank" not in run.stderr


@pytest.mark.slow
@pytest.mark.parametrize("start", [PLAIN, DRIVER])
@pytest.mark.parametrize("code", [0, None, "the reason"])
def test_sys_exit_on_all_ranks_is_an_ordinary_end(code, start):
    run = ended("each", code, "True", start)
    assert run.returncode == (1 if code else 0), run.stderr
    assert run.stderr.count("the reason") == (1 if code else 0), run.stderr


@pytest.mark.slow
@pytest.mark.parametrize("error", ["KeyboardInterrupt", "GeneratorExit", "BaseException('x')"])
def test_other_exceptions_on_one_rank_end_all(error):
    code = PROGRAM.format(place="each", code=0, who="rank == 1", start=PLAIN)
    run = on_ranks(2, "-c", code.replace("sys.exit(0)", f"raise {error}"))
    assert run.returncode == 1
    assert run.stderr.count("Traceback") == 1, run.stderr


@pytest.mark.slow
def test_a_rank_at_the_end_reports_that_others_are_not():
    code = """
import sys, time
from mpi4py import MPI
import tawami
from tawami.base import program
program.NOTICE = 0.5
tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=0.5, cells=(4, 2))
if MPI.COMM_WORLD.rank == 1:
    sys.exit()
time.sleep(2)
"""
    run = on_ranks(2, "-c", code)
    assert run.returncode == 0, run.stderr
    assert run.stderr.count("rank 1 reached the end of the program 0.5 s ago") == 1
