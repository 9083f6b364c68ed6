"""The benchmark against another checkout: ratios of paired steps, and checkouts that cannot be used."""

from __future__ import annotations

import csv
import re

import pytest

import tawami
from cases.costs import ordering, solvers
from cases.costs.bench import __main__ as bench
from cases.costs.bench import borders, compare


def test_ratios_are_medians_over_pairs():
    new, old = {"tangent": 3.0, "whole step": 5.0}, {"tangent": 6.0, "whole step": 10.0}
    steps = [(new | {"law": 2.0 * t}, old | {"law": t}) for t in (1.0, 7.0, 2.0)]
    rows = {row.stage: row for row in compare.rows_of("beam", steps)}
    assert set(rows) == {"law", "tangent", "residual calls", "tangent calls", "whole step"}
    assert (rows["law"].ratio, rows["residual calls"].ratio) == (2.0, 2.0)
    assert rows["tangent"].ratio == rows["tangent calls"].ratio == rows["whole step"].ratio == 0.5
    assert (rows["law"].new_ms, rows["law"].old_ms) == (4000.0, 2000.0)


@pytest.mark.slow
def test_a_checkout_against_itself(tmp_path, capsys):
    sizes = ["--cells", "2", "--particles", "800", "--rounds", "1", "--pairs", "1"]
    options = [*sizes, "--old-kernels", "Prescott", "--results", str(tmp_path)]
    bench.main([*options, "--against", str(compare.ROOT)])
    printed = capsys.readouterr().out
    assert f"old: {compare.ROOT}" in printed
    with (tmp_path / "against.csv").open(newline="") as file:
        rows = {(row["scene"], row["stage"]): row for row in csv.DictReader(file)}
    for scene in ("beam 2", "collapse 800"):
        for stage in ("residual calls", "tangent calls", "whole step"):
            row = rows[scene, stage]
            ratio = float(row["new_ms"]) / float(row["old_ms"])
            assert float(row["ratio"]) == pytest.approx(ratio)


def test_terms_on_the_border_are_compared_in_one_run(capsys):
    borders.print_ratios([2], pairs=2)
    lines = capsys.readouterr().out.splitlines()
    found = [re.search(r": ([\d.]+) \(([\d.]+) to ([\d.]+)\), iterations \d+ / \d+,", text)
             for text in lines if "/" in text]  # fmt: skip
    assert len(found) == 3
    for one in found:
        ratio, low, high = map(float, one.groups())
        assert 0 < low <= ratio <= high


def test_every_ordering_is_measured(tmp_path):
    sizes = ["--cells", "2", "--pile-cells", "10", "--repeat", "1"]
    ordering.main([*sizes, "--results", str(tmp_path)])
    with (tmp_path / "ordering.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["ordering"] for row in rows] == 2 * list(ordering.ORDERINGS)
    assert {row["method"] for row in rows[4:]} == {"LU"}
    assert all(float(row["numeric_ms"]) > 0 for row in rows)


@pytest.mark.slow
def test_every_linear_solver_is_measured(tmp_path):
    sizes = ["--cells", "2", "--particles", "800", "--steps", "1"]
    solvers.main([*sizes, "--results", str(tmp_path)])
    with (tmp_path / "solvers.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["solver"] for row in rows] == 2 * list(solvers.SOLVERS)
    assert all(float(row["seconds"]) > 0 for row in rows)
    assert {row["scene"] for row in rows} == {"beam 2", "pile 800"}


def test_a_checkout_that_is_not_set_up(tmp_path):
    with pytest.raises(tawami.InputError, match="run make setup in it"):
        next(compare.compare(tmp_path, [2], [800], rounds=1, pairs=1, threads=1))


def test_a_package_that_cannot_be_imported(tmp_path):
    package = tmp_path / "python" / "tawami"
    package.mkdir(parents=True)
    (package / "_rust.so").touch()
    (package / "__init__.py").write_text("raise ImportError('broken')")
    with pytest.raises(tawami.TawamiError, match="(?s)failed: .*ImportError: broken"):
        next(compare.compare(tmp_path, [2], [800], rounds=1, pairs=1, threads=1))
