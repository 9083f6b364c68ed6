"""Studies: which settings are run, what is kept of each run, which failures are reported."""

from __future__ import annotations

import json
import os
import sys
import time

import numpy as np
import pytest
from mpi4py import MPI
from programs import python

import tawami
from tawami.study import Series, Table, process, verdict
from tawami.study.peers import read_peers

MB = 2**20


#: Read by `scaled`.
FACTOR = 1.0


# -- functions that studies run --------------------------------------------------


def converges(n, order=1):
    """Converge to 1 with first or second order."""
    return {"x": 1 + 1 / n**order, "unknowns": n}


def scaled(n):
    """Return a constant of this file."""
    return {"x": FACTOR * n}


def stretched(n, tolerance=1e-6):
    """Solve a bar of n cells in tension."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0.0, 0.0), h=1 / n, cells=(n, 1))
    body = tawami.box(grid, (0.0, 0.0), (1.0, 1 / n), per_axis=3, gauss=True)
    material = tawami.linear_elastic(E=1e6, nu=0.0)
    scene = tawami.Scene(grid, body, material, form="u", tolerance=tolerance)
    scene.fix("left", "x")
    scene.fix("bottom", "y")
    scene.traction("right", (1e3, 0.0))
    return {"end": scene.solve().displacement((1.0, 0.0))[0]}


def misbehaves(how):
    """Fail in one of several ways, or return 1."""
    if how == "sleeps":
        time.sleep(600)
    if how == "dies":
        os._exit(3)
    if how == "refuses":
        raise tawami.InputError("no")
    if how == "divides":
        return {"x": 1 / 0}
    if how == "a list":
        return [1.0]
    return {"x": {"nan": np.nan, "is complex": np.complex128(1.0), "is well": 1.0}[how], "y": 1.0}


def allocates(megabytes):
    """Allocate memory; return the number of threads that the process may use."""
    np.ones(megabytes * MB // 8)
    return {"threads": float(os.environ["RAYON_NUM_THREADS"])}


def profile(n):
    return {"profile": (np.linspace(0, 1, 5) ** 2 * (1 + 1 / n)).tolist()}


# -- running -----------------------------------------------------------------------


@pytest.fixture
def in_this_process(monkeypatch, tmp_path_factory):
    """Run the functions of studies here: a process of its own costs a second."""
    folder = tmp_path_factory.mktemp("jobs")

    def measure(name, knobs, _limit):
        job, result = folder / "job.json", folder / "result.json"
        job.write_text(json.dumps({"name": name, "knobs": dict(knobs)}))
        with monkeypatch.context() as patch:
            patch.setattr(sys, "argv", ["study", str(job), str(result)])
            process.main()
        return json.loads(result.read_text())

    monkeypatch.setattr(process, "measure", measure)


@pytest.mark.usefixtures("in_this_process")
def test_every_setting_is_run_once(tmp_path, capsys):
    grids = [{"n": (2, 4), "order": (1, 2)}, {"n": (4, 8), "order": (2,)}]
    study = tawami.Study(
        "toy", Series("MPM", converges, grids), reference={"x": 1.0}, folder=tmp_path
    )
    table = study.run()
    expected = [(2, 1), (2, 2), (4, 1), (4, 2), (8, 2)]
    assert [(row.knobs["n"], row.knobs["order"]) for row in table.rows] == expected
    assert [row.errors["x"] for row in table.rows] == pytest.approx([1 / n**k for n, k in expected])
    assert "[5/5] MPM: n 8, order 2" in capsys.readouterr().err
    before = (tmp_path / "runs.jsonl").read_bytes()
    assert study.run().rows == table.rows
    assert (tmp_path / "runs.jsonl").read_bytes() == before
    assert {"toy.csv", "toy.png", "runs.jsonl"} == {path.name for path in tmp_path.glob("[!.]*")}


@pytest.mark.usefixtures("in_this_process")
def test_an_interrupted_study_resumes(tmp_path):
    study = tawami.Study("toy", converges, {"n": (2, 4, 8)}, {"x": 1.0}, folder=tmp_path)
    study.run(quiet=True)
    path = tmp_path / "runs.jsonl"
    lines = path.read_text().splitlines()
    path.write_text(lines[0] + "\n" + lines[1][: len(lines[1]) // 2])
    assert len(study.table().rows) == 1
    table = study.run(quiet=True)
    assert [row.knobs["n"] for row in table.rows] == [2, 4, 8]
    kept = path.read_text().splitlines()
    assert kept[0] == lines[0]
    assert len(kept) == 4
    assert [json.loads(line)["knobs"]["n"] for line in kept[2:]] == [4, 8]


@pytest.mark.usefixtures("in_this_process")
def test_a_seed_gives_the_same_sample(tmp_path):
    def sampled(folder: str, seed: int) -> list[int]:
        study = tawami.Study(
            "toy", converges, {"n": tuple(range(1, 40))}, {"x": 1.0}, folder=tmp_path / folder
        )
        return [row.knobs["n"] for row in study.run(sample=3, seed=seed, quiet=True).rows]

    one, again, other = sampled("a", 1), sampled("b", 1), sampled("c", 2)
    assert one == again != other
    assert len(set(one)) == 3


@pytest.mark.usefixtures("in_this_process")
def test_newton_iterations_steps_and_unknowns_are_counted(tmp_path):
    study = tawami.Study("bar", stretched, {"n": (2, 4)}, {"end": 1e-3}, folder=tmp_path)
    rows = study.run(quiet=True).rows
    assert [row.errors["end"] for row in rows] == pytest.approx([0, 0], abs=1e-9)
    # n + 2 splines along the bar and 3 across, in two components, less those of one end and one side
    assert [row.costs["unknowns"] for row in rows] == [(n + 1) * 3 + (n + 2) * 2 for n in (2, 4)]
    assert [(row.costs["steps"], row.costs["newton_iterations"]) for row in rows] == [(1, 1)] * 2


@pytest.mark.usefixtures("in_this_process")
def test_the_finest_run_is_a_reference(tmp_path):
    study = tawami.Study(
        "toy", profile, {"n": (2, 4)}, {"profile": None}, finest={"n": 100}, folder=tmp_path
    )
    errors = [row.errors["profile"] for row in study.run(quiet=True).rows]
    assert errors == pytest.approx([(1 / n - 0.01) / 1.01 for n in (2, 4)])


@pytest.mark.usefixtures("in_this_process")
def test_failed_runs_are_reported_and_the_others_are_run(tmp_path):
    ways = ("refuses", "divides", "nan", "is complex", "a list", "is well")
    study = tawami.Study("toy", misbehaves, {"how": ways}, {"x": 1.0}, folder=tmp_path)
    table = study.run(quiet=True)
    *failures, last = table.rows
    assert last.failure is None
    expected = (
        "InputError: no", "ZeroDivisionError", "quantity 'x' is not finite",
        "(1+0j): expected real numbers", "returned list: expected a mapping",
    )  # fmt: skip
    for row, words in zip(failures, expected, strict=True):
        assert words in row.failure
    assert len(table.failed) == 5
    assert "5 of 6 runs failed" in verdict(table)


def test_a_process_that_dies_does_not_stop_a_study(tmp_path):
    study = tawami.Study(
        "toy", misbehaves, {"how": ("dies", "is well")}, {"x": 1.0}, folder=tmp_path
    )
    first, second = study.run(quiet=True).rows
    assert "ended with code 3" in first.failure
    assert second.failure is None


def test_a_run_that_takes_too_long_is_ended(tmp_path):
    study = tawami.Study("toy", misbehaves, {"how": ("sleeps",)}, {"x": 1.0}, folder=tmp_path)
    (row,) = study.run(limit=0.5, quiet=True).rows
    assert "limit of 0.5 s" in row.failure
    study.run(limit=0.5, quiet=True)  # tried again, unlike a run that raises an error
    assert len((tmp_path / "runs.jsonl").read_text().splitlines()) == 2


def test_each_run_has_its_own_memory_and_threads(tmp_path):
    grids = [{"megabytes": (8,), "threads": (1,)}, {"megabytes": (208,), "threads": (3,)}]
    series = Series("MPM", allocates, grids)
    study = tawami.Study("toy", series, reference={"threads": 1.0}, folder=tmp_path)
    small, large = study.run(quiet=True).rows
    assert large.costs["peak_MB"] - small.costs["peak_MB"] == pytest.approx(200, abs=20)
    assert (small.values["threads"], large.values["threads"]) == (1, 3)


def test_a_driver_script_runs_a_study_of_its_own_function(tmp_path):
    script = tmp_path / "script.py"
    script.write_text(
        "import tawami\n"
        "def run(n):\n    return {'x': 1 + 1 / n}\n"
        "study = tawami.Study('mine', run, {'n': (100,)}, {'x': 1.0}, folder='out')\n"
        "if __name__ == '__main__':\n    study.run()\n    print(tawami.recommend(study, 0.05))\n"
    )
    run = python(script.name, cwd=tmp_path, check=True)
    assert run.stdout.startswith("MPM: n 100: errors x 0.01")
    unguarded = script.read_text().replace("if __name__ == '__main__':", "if True:")
    script.write_text(unguarded.replace("(100,)", "(20,)"))
    run = python(script.name, cwd=tmp_path)
    assert 'put study.run() under if __name__ == "__main__":' in run.stderr


# -- what is rejected ----------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"function": lambda n: {}}, "expected a function at the top level of a file"),
        ({"knobs": {"n": 3}}, "knob 'n' = 3: expected a list of its values"),
        ({"knobs": {"n": ([1, 2],)}}, "expected numbers, names, booleans or None"),
        ({"knobs": {"n": ()}}, "expected a list of its values"),
        ({"reference": {}}, "has no reference"),
        ({"reference": {"x": None}}, "no reference for x: expected a value, or the knobs"),
        ({"beside": [Series("MPM", profile, {"n": (1,)})]}, "two series of one label"),
    ],
)
def test_a_wrong_study_is_rejected(options, message):
    given = {"function": converges, "knobs": {"n": (1, 2)}, "reference": {"x": 1.0}} | options
    with pytest.raises(tawami.InputError, match=message):
        tawami.Study("toy", **given)


@pytest.mark.usefixtures("in_this_process")
def test_a_study_without_runs_or_without_a_quantity_raises_an_error(tmp_path):
    study = tawami.Study("toy", converges, {"n": (1,)}, {"z": 1.0}, folder=tmp_path)
    with pytest.raises(tawami.InputError, match="nothing has been run"):
        study.table()
    with pytest.raises(tawami.InputError, match="its function returned no quantity 'z'"):
        study.run(quiet=True)


# -- the studies of cases/trade ------------------------------------------------------


def test_shipped_results_belong_to_shipped_studies():
    """The shipped tables hold every setting of the studies, and other codes have the same quantities."""
    from cases.costs.trade.__main__ import PEERS, SHIPPED, STUDIES

    for path in PEERS.glob("*.csv"):
        quantities = STUDIES[path.stem].reference.keys()
        assert all(peer.errors.keys() == quantities for peer in read_peers(path)), path

    for name, study in STUDIES.items():
        table = Table.read(SHIPPED / f"{name}.csv")
        for series in study.series:
            wanted = [{k: v for k, v in s.items() if v is not None} for s in series.settings()]
            shipped = [dict(row.knobs) for row in table.rows if row.series == series.label]
            assert all(setting in shipped for setting in wanted), (name, series.label)
        assert (SHIPPED / f"{name}.png").exists()


@pytest.mark.slow
def test_cases_trade_runs_a_sample(tmp_path):
    run = python(
        "-m", "cases.costs.trade", "cook", "--sample", "2", "--results", tmp_path, check=True
    )
    assert "| change |" in run.stdout
    assert (tmp_path / "cook" / "cook.png").exists()


def test_a_run_depends_on_the_constants_that_its_function_reads(monkeypatch):
    before = process.fingerprint(scaled)
    assert process.fingerprint(scaled) == before
    monkeypatch.setitem(globals(), "FACTOR", 2.0)
    assert process.fingerprint(scaled) != before
