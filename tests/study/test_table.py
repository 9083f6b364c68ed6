"""Tables of studies: front, knee, effect of each knob, recommended setting; with known errors."""

from __future__ import annotations

import numpy as np
import pytest

import tawami
from tawami.study import Row, Table, figure, verdict
from tawami.study.peers import comparison, read_peers
from tawami.study.row import error_of


def table_of(*points: tuple[float, float], **knobs: tuple) -> Table:
    """A table of runs with these costs and errors."""
    rows = []
    for k, (cost, error) in enumerate(points):
        setting = {name: values[k] for name, values in knobs.items()} or {"n": k}
        costs = {"wall_s": cost, "cpu_s": cost, "peak_MB": 1.0, "newton_iterations": 1,
                 "steps": 1, "unknowns": 1}  # fmt: skip
        rows.append(Row("MPM", setting, {"x": error}, {"x": error}, costs))
    return Table("toy", rows)


def test_no_run_of_the_front_is_worse_in_cost_and_error():
    table = table_of((1, 1e-1), (2, 2e-1), (2, 1e-2), (4, 1e-2), (8, 1e-3), (9, 5e-3))
    assert [row.knobs["n"] for row in table.front("x")] == [0, 2, 4]


def test_the_knee_is_the_corner_of_an_l():
    table = table_of((1, 1.0), (1.1, 0.1), (1.2, 1e-2), (2, 1e-3), (10, 8e-4), (100, 7e-4))
    assert table.knee("x").knobs["n"] == 3
    # a straight line has no corner but its ends
    line = table_of(*((2.0**k, 4.0**-k) for k in range(5)))
    assert {row.knobs["n"] for row in line.knees("x")} >= {0, 4}


def test_changes_compare_pairs_that_differ_in_one_knob():
    table = table_of(
        (1, 0.1), (2, 0.01), (3, 0.2), (12, 0.005), (5, 0.3),
        n=(1, 2, 1, 2, 1), form=("a", "a", "b", "b", "c"),
    )  # fmt: skip
    (of_n,) = (c for c in table.changes("x") if c.knob == "n")
    assert (of_n.pairs, of_n.before, of_n.after) == (2, 1, 2)
    assert of_n.error == pytest.approx((0.1 * 0.025) ** 0.5)
    assert of_n.cost == pytest.approx((2 * 4) ** 0.5)


def test_the_verdict_has_a_row_for_each_knob():
    table = table_of(
        (1, 0.1), (2, 0.01), (3, 0.2), (6, 0.02), (2, 0.1), (4, 0.01),
        n=(1, 2, 1, 2, 1, 2), form=("a", "a", "b", "b", "a", "a"), slow=(0, 0, 0, 0, 1, 1),
    )  # fmt: skip
    assert verdict(table).splitlines() == [
        "| change | error of x | time |  |",
        "| --- | --- | --- | --- |",
        "| n 1 → 2 | x 0.1 | x 2 | reduces the error |",
        "| form a → b | x 2 | x 3 | only costs time |",
        "| slow 0 → 1 | x 1 | x 2 | only costs time |",
        "",
        "The error is reduced by n 1 → 2. More time without more accuracy: form a → b and slow 0 → 1.",
    ]


PEERS = "code,version,command,machine,source,setting,wall_s,x\n"


def test_results_of_other_codes_are_read(tmp_path):
    path = tmp_path / "toy.csv"
    path.write_text(f"{PEERS}other,1.2,other run.in,8 cores,,h = 1,3.5,0.01\n"
                    "paper,2020,read from table 1,unknown,Doe 2020,h = 1,,0.02\n")  # fmt: skip
    one, two = read_peers(path)
    assert (one.label, one.wall_s, one.errors) == ("other 1.2", 3.5, {"x": 0.01})
    assert np.isnan(two.wall_s)
    figure.picture(table_of((1, 0.1), (2, 0.01)), tmp_path / "toy.png", peers=[one, two])
    assert (tmp_path / "toy.png").exists()
    for line, message in (
        ("other,,run,8 cores,,h = 1,3,0.1", "line 2: version is empty: expected the origin"),
        ("other,1,run,8 cores,,h = 1,soon,0.1", "line 2: .*'soon': expected numbers"),
    ):
        path.write_text(f"{PEERS}{line}\n")
        with pytest.raises(tawami.InputError, match=message):
            read_peers(path)
    path.write_text("code,x\nother,1\n")
    with pytest.raises(tawami.InputError, match="has no column version, command"):
        read_peers(path)


def test_runs_on_the_front_of_another_code_are_compared_with_the_fastest_run_as_accurate(tmp_path):
    path = tmp_path / "toy.csv"
    runs = ("h = 1,3,0.1", "slower and worse,4,0.2", "h = 1/2,30,0.02", "h = 1/8,300,0.001",
            "not timed,,0.0001")  # fmt: skip
    path.write_text(PEERS + "".join(f"other,1.2,run,8 cores,,{run}\n" for run in runs))
    table = table_of((1, 0.1), (2, 0.01), (0.5, 0.05), n=(1, 2, 4), form=("a", "a", "b"))
    assert comparison(table, read_peers(path), {"n": ..., "form": "a"}).splitlines() == [
        "Runs of other codes, and the fastest run at least as accurate with form a:",
        "",
        "| other code | error of x | time | MPM | error | time | other time / own |",
        "| --- | --- | --- | --- | --- | --- | --- |",
        "| other 1.2: h = 1 | 0.1 | 3 s | n 1 | 0.1 | 1 s | 3 |",
        "| other 1.2: h = 1/2 | 0.02 | 30 s | n 2 | 0.01 | 2 s | 15 |",
        "| other 1.2: h = 1/8 | 0.001 | 300 s | none |  |  |  |",
    ]


def test_a_table_is_read_from_its_file(tmp_path):
    table = table_of((1, 0.1), (2, 0.01), n=(1, 2), form=("a", "b"), fast=(True, False))
    path = tmp_path / "toy.csv"
    path.write_text(table.as_csv())
    assert Table.read(path) == table
    text = table.as_csv()
    for new, message in [
        (text.replace("MPM,1,", "MPM,1,000,"), "line 2 has .*, and the header .*: expected one cell"),
        (text.replace("knobs: form", "knobs: n"), "expected the CSV file that"),
        ("", r"cannot be read \(it is empty\): expected the CSV file that"),
    ]:  # fmt: skip
        path.write_text(new)
        with pytest.raises(tawami.InputError, match=message):
            Table.read(path)


def test_the_cheapest_setting_within_a_tolerance_is_recommended(tmp_path):
    table = table_of((1, 0.1), (2, 0.01), (3, 0.02), (4, 1e-3))
    assert tawami.recommend(table, 0.05).knobs == {"n": 1}
    assert tawami.recommend(table, {"x": 5e-3}).knobs == {"n": 3}
    with pytest.raises(tawami.InputError, match=r"within x 1e-06: the nearest is MPM: n 3: errors"):
        tawami.recommend(table, 1e-6)
    with pytest.raises(tawami.InputError, match="quantity 'y' of study 'toy': expected one of 'x'"):
        tawami.recommend(table, {"y": 0.1})
    with pytest.raises(tawami.InputError, match=r"nowhere.csv.*expected the CSV file"):
        tawami.recommend(tmp_path / "nowhere.csv", 0.1)


def test_errors_are_relative_unless_the_reference_is_zero():
    assert error_of(1.1, 1.0) == pytest.approx(0.1)
    assert error_of(-0.3, 0.0) == pytest.approx(0.3)
    assert error_of([3.0, 4.0], [0.0, 0.0]) == pytest.approx(5.0)
    with pytest.raises(tawami.InputError, match="2 numbers and its reference 1"):
        error_of([1.0, 2.0], 1.0)
