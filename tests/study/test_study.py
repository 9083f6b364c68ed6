"""Studies: what is run, what is kept, errors, front, recommendation; with functions of known cost."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

import tawami
from tawami.study import Row, Series, Table
from tawami.study.row import error_of

MB = 2**20


# -- functions that studies run --------------------------------------------------


def converges(n, order=1):
    """First or second order towards 1."""
    return {"x": 1 + 1 / n**order, "unknowns": n}


def stretched(n, tolerance=1e-6):
    """A bar of n cells in tension: a real scene."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0.0, 0.0), h=1 / n, cells=(n, 1))
    body = tawami.box(grid, (0.0, 0.0), (1.0, 1 / n), per_axis=3, gauss=True)
    material = tawami.linear_elastic(E=1e6, nu=0.0)
    scene = tawami.Scene(grid, body, material, form="u", tolerance=tolerance)
    scene.fix("left", "x")
    scene.fix("bottom", "y")
    scene.traction("right", (1e3, 0.0))
    return {"end": scene.solve().displacement((1.0, 0.0))[0]}


def misbehaves(how):
    """In one of many ways."""
    if how == "sleeps":
        time.sleep(60)
    if how == "dies":
        os._exit(3)
    if how == "refuses":
        raise tawami.InputError("no")
    if how == "divides":
        return {"x": 1 / 0}
    return {"x": {"nan": np.nan, "is well": 1.0}.get(how), "y": 1.0} if how != "a list" else [1.0]


def allocates(megabytes):
    return {"x": float(np.ones(megabytes * MB // 8).sum() > 0)}


def threads():
    return {"x": float(os.environ["RAYON_NUM_THREADS"])}


def profile(n):
    return {"profile": (np.linspace(0, 1, 5) ** 2 * (1 + 1 / n)).tolist()}


# -- running -----------------------------------------------------------------------


def test_every_setting_once_and_nothing_twice(tmp_path, capsys):
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
    assert {"toy.csv", "toy.png", "runs.jsonl"} == {path.name for path in tmp_path.iterdir()}


def test_a_study_that_was_cut_off_goes_on_where_it_was(tmp_path):
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


def test_a_sample_is_part_of_the_grid_and_the_same_for_a_seed(tmp_path):
    def sampled(folder: str, seed: int) -> list[int]:
        study = tawami.Study(
            "toy", converges, {"n": tuple(range(1, 40))}, {"x": 1.0}, folder=tmp_path / folder
        )
        return [row.knobs["n"] for row in study.run(sample=3, seed=seed, quiet=True).rows]

    one, again, other = sampled("a", 1), sampled("b", 1), sampled("c", 2)
    assert one == again != other
    assert len(set(one)) == 3


def test_newton_iterations_steps_and_unknowns_are_counted(tmp_path):
    study = tawami.Study("bar", stretched, {"n": (2, 4)}, {"end": 1e-3}, folder=tmp_path)
    rows = study.run(quiet=True).rows
    assert [row.errors["end"] for row in rows] == pytest.approx([0, 0], abs=1e-9)
    # splines along and across: n + 2 and 3 in two directions, those of one end and one side held
    assert [row.costs["unknowns"] for row in rows] == [(n + 1) * 3 + (n + 2) * 2 for n in (2, 4)]
    assert [(row.costs["steps"], row.costs["newton_iterations"]) for row in rows] == [(1, 1)] * 2


def test_what_goes_wrong_in_a_run_is_told_and_the_others_go_on(tmp_path):
    ways = ("refuses", "divides", "dies", "nan", "a list", "is well")
    study = tawami.Study("toy", misbehaves, {"how": ways}, {"x": 1.0}, folder=tmp_path)
    table = study.run(quiet=True)
    *failures, last = table.rows
    assert last.failure is None
    expected = (
        "InputError: no", "ZeroDivisionError", "ended with code 3", "quantity 'x' is not finite",
        "returned list: expected a mapping",
    )  # fmt: skip
    for row, words in zip(failures, expected, strict=True):
        assert words in row.failure
    assert len(table.failed) == 5
    assert "5 of 6 runs failed" in table.in_words("x")


def test_a_run_that_takes_too_long_is_ended(tmp_path):
    study = tawami.Study("toy", misbehaves, {"how": ("sleeps",)}, {"x": 1.0}, folder=tmp_path)
    start = time.perf_counter()
    (row,) = study.run(limit=2.0, quiet=True).rows
    assert "limit of 2 s" in row.failure
    assert time.perf_counter() - start < 20
    study.run(limit=1.0, quiet=True)  # tried again, unlike one that refuses
    assert len((tmp_path / "runs.jsonl").read_text().splitlines()) == 2


def test_memory_and_threads_are_those_of_the_run(tmp_path):
    study = tawami.Study("m", allocates, {"megabytes": (8, 208)}, {"x": 1.0}, folder=tmp_path / "m")
    small, large = (row.costs["peak_MB"] for row in study.run(quiet=True).rows)
    assert large - small == pytest.approx(200, abs=20)
    study = tawami.Study("t", threads, {"threads": (1, 3)}, {"x": 1.0}, folder=tmp_path / "t")
    assert [row.values["x"] for row in study.run(quiet=True).rows] == [1, 3]


def test_the_finest_run_is_a_reference(tmp_path):
    study = tawami.Study(
        "toy", profile, {"n": (2, 4)}, {"profile": None}, finest={"n": 100}, folder=tmp_path
    )
    errors = [row.errors["profile"] for row in study.run(quiet=True).rows]
    assert errors == pytest.approx([(1 / n - 0.01) / 1.01 for n in (2, 4)])


def test_a_driver_script_runs_a_study_of_its_own_function(tmp_path):
    script = tmp_path / "script.py"
    script.write_text(
        "import tawami\n"
        "def run(n):\n    return {'x': 1 + 1 / n}\n"
        "study = tawami.Study('mine', run, {'n': (10, 100)}, {'x': 1.0}, folder='out')\n"
        "if __name__ == '__main__':\n    study.run()\n    print(tawami.recommend(study, 0.05))\n"
    )
    command = [sys.executable, script.name]
    run = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
    assert run.stdout.startswith("MPM: n 100: errors x 0.01")
    script.write_text(script.read_text().replace("if __name__ == '__main__':", "if True:"))
    again = script.read_text().replace("(10, 100)", "(10, 20)")
    script.write_text(again)
    run = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert 'put study.run() under if __name__ == "__main__":' in run.stderr


# -- what it says --------------------------------------------------------------------


def table_of(*points: tuple[float, float], **knobs: tuple) -> Table:
    rows = []
    for k, (cost, error) in enumerate(points):
        setting = {name: values[k] for name, values in knobs.items()} or {"n": k}
        costs = {"wall_s": cost, "cpu_s": cost, "peak_MB": 1.0, "newton_iterations": 1,
                 "steps": 1, "unknowns": 1}  # fmt: skip
        rows.append(Row("MPM", setting, {"x": error}, {"x": error}, costs))
    return Table("toy", rows)


def test_the_front_is_what_nothing_beats():
    table = table_of((1, 1e-1), (2, 2e-1), (2, 1e-2), (4, 1e-2), (8, 1e-3), (9, 5e-3))
    assert [row.knobs["n"] for row in table.front("x")] == [0, 2, 4]


def test_the_knee_is_the_corner_of_an_l():
    table = table_of((1, 1.0), (1.1, 0.1), (1.2, 1e-2), (2, 1e-3), (10, 8e-4), (100, 7e-4))
    assert table.knee("x").knobs["n"] == 3
    # on a line no corner but the ends
    line = table_of(*((2.0**k, 4.0**-k) for k in range(5)))
    assert {row.knobs["n"] for row in line.knees("x")} >= {0, 4}


def test_changes_are_those_of_pairs_that_differ_in_one_knob():
    table = table_of(
        (1, 0.1), (2, 0.01), (3, 0.2), (12, 0.005), (5, 0.3),
        n=(1, 2, 1, 2, 1), form=("a", "a", "b", "b", "c"),
    )  # fmt: skip
    (of_n,) = (c for c in table.changes("x") if c.knob == "n")
    assert (of_n.pairs, of_n.before, of_n.after) == (2, 1, 2)
    assert of_n.error == pytest.approx((0.1 * 0.025) ** 0.5)
    assert of_n.cost == pytest.approx((2 * 4) ** 0.5)
    assert ("form", "c") in table.dominated("x")
    assert ("form", "a") not in table.dominated("x")
    assert "Accuracy is bought by n 1 to 2" in table.in_words("x")


def test_a_table_survives_its_file(tmp_path):
    table = table_of((1, 0.1), (2, 0.01), n=(1, 2), form=("a", "b"), fast=(True, False))
    path = tmp_path / "toy.csv"
    path.write_text(table.as_csv())
    assert Table.read(path) == table


def test_the_cheapest_setting_within_a_tolerance(tmp_path):
    table = table_of((1, 0.1), (2, 0.01), (3, 0.02), (4, 1e-3))
    assert tawami.recommend(table, 0.05).knobs == {"n": 1}
    assert tawami.recommend(table, {"x": 5e-3}).knobs == {"n": 3}
    with pytest.raises(tawami.InputError, match=r"within x 1e-06: the nearest is MPM: n 3: errors"):
        tawami.recommend(table, 1e-6)
    with pytest.raises(tawami.InputError, match="quantity 'y' of study 'toy': expected one of 'x'"):
        tawami.recommend(table, {"y": 0.1})
    with pytest.raises(tawami.InputError, match=r"nowhere.csv.*expected the CSV file"):
        tawami.recommend(tmp_path / "nowhere.csv", 0.1)


def test_errors_are_relative_but_for_a_reference_of_zero():
    assert error_of(1.1, 1.0) == pytest.approx(0.1)
    assert error_of(-0.3, 0.0) == pytest.approx(0.3)
    assert error_of([3.0, 4.0], [0.0, 0.0]) == pytest.approx(5.0)
    with pytest.raises(tawami.InputError, match="2 numbers and its reference 1"):
        error_of([1.0, 2.0], 1.0)


# -- what is refused -----------------------------------------------------------------


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
def test_studies_that_cannot_be_run_are_refused(options, message):
    given = {"function": converges, "knobs": {"n": (1, 2)}, "reference": {"x": 1.0}} | options
    with pytest.raises(tawami.InputError, match=message):
        tawami.Study("toy", **given)


def test_a_quantity_that_no_run_returns_and_a_study_that_was_not_run(tmp_path):
    study = tawami.Study("toy", converges, {"n": (1,)}, {"z": 1.0}, folder=tmp_path)
    with pytest.raises(tawami.InputError, match="nothing has been run"):
        study.table()
    with pytest.raises(tawami.InputError, match="its function returned no quantity 'z'"):
        study.run(quiet=True)


def test_the_shipped_results_are_those_of_the_shipped_studies():
    """Their settings are those that the studies would run, and each front has its knee."""
    from cases.trade.__main__ import SHIPPED, STUDIES

    for name, study in STUDIES.items():
        table = Table.read(SHIPPED / f"{name}.csv")
        for series in study.series:
            wanted = [{k: v for k, v in s.items() if v is not None} for s in series.settings()]
            shipped = [dict(row.knobs) for row in table.rows if row.series == series.label]
            assert all(setting in shipped for setting in wanted), (name, series.label)
        assert (SHIPPED / f"{name}.png").exists()


def test_the_trade_runs_a_sample(tmp_path):
    root = Path(__file__).parents[2]
    run = subprocess.run(
        [sys.executable, "-m", "cases.trade", "cook", "--sample", "2", "--results", str(tmp_path)],
        cwd=root, capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert "The knee:" in run.stdout
    assert (tmp_path / "cook" / "cook.png").exists()
