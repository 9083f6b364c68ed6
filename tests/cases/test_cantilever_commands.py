"""The commands of the cantilever: its study, its benchmark, and what writing costs."""

from __future__ import annotations

import csv

import pytest
from programs import python

from cases.costs import writing
from cases.costs.bench import __main__ as bench
from cases.verification.cantilever import __main__ as study
from cases.verification.cantilever.beam import COLUMNS, SUPPORTS


def test_the_study_writes_table_figures_fields_and_report(tmp_path, capsys):
    """On two coarse grids: every method and support."""
    study.main(["--results", str(tmp_path), "--cells", "2,4"])
    with (tmp_path / "cantilever.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert tuple(rows[0]) == COLUMNS
    methods = {row["method"] for row in rows}
    assert methods == {"u", "u_bbar", "u_epsv", "fem_q2", "fem_taylor_hood", "fem_q1_bbar"}
    assert len(rows) == 3 * (8 + 3) * 2
    alphas = {row["alpha"] for row in rows if row["method"] == "u_epsv"}
    assert alphas == {"0.0", "0.1", "0.2", "0.3", "0.4", "0.5"}
    for row in rows:
        assert (row["mean_stress_l2"] != "") == (row["support"] == "exact")
        assert (row["particles_per_cell"] == "") == row["method"].startswith("fem")
        assert (row["alpha"] != "") == (row["method"] == "u_epsv")
        assert row["newton_iterations"] == "1"
        assert float(row["error_percent"]) == pytest.approx(
            100 * (float(row["deflection_m"]) / 0.0102508666 - 1), abs=1e-5
        )
    for name in ("deflection_error", "mean_stress_paper", "mean_stress_exact"):
        data = (tmp_path / f"{name}.png").read_bytes()
        assert data.startswith(b"\x89PNG")
        assert len(data) > 30_000
    assert len(list(tmp_path.glob("*.vtu"))) == 16
    report = (tmp_path / "report.md").read_text()
    assert "has no limit" in report
    assert "1.08 % of v_theory" in report
    assert all(f"## Support `{support}`" in report for support in SUPPORTS)
    printed = capsys.readouterr().out
    assert "BLAS" in printed
    assert "66 computations" in printed
    assert str(tmp_path / "report.md") in printed
    assert not list(tmp_path.glob(".*"))


@pytest.mark.parametrize("cells", ["3", "two", "", "0"])
def test_wrong_cells_are_rejected(cells, capsys):
    with pytest.raises(SystemExit):
        study.main(["--cells", cells])
    assert "expected even numbers such as 2,4,8" in capsys.readouterr().err


@pytest.mark.slow
def test_the_benchmark_prints_its_ratios(capsys, tmp_path):
    """On small grids, without a check of the times themselves."""
    options = ["--cells", "4,8", "--per-axis", "2", "--threads", "1", "--ranks", "2"]
    bench.main([*options, "--results", str(tmp_path)])
    printed = capsys.readouterr().out
    for words in (
        "all but the factorisation: ", "particle stages: ", "FGMRES iterations [0, ",
        "us per particle and iteration", "dolfinx over points", "2 ranks: step ", "growth, ",
        "another set of active cells", "of them empty:", "BLAS",
    ):  # fmt: skip
        assert words in printed
    with (tmp_path / "bench.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [(row["assembly"], row["ranks"]) for row in rows[:3]] == [
        ("points", "1"), ("dolfinx", "1"), ("points", "2")
    ]  # fmt: skip
    deflections = [float(row["deflection_m"]) for row in rows[:3]]
    assert deflections == pytest.approx([deflections[0]] * 3, rel=1e-10)
    assert all(float(row["peak_MB"]) > 10 for row in rows)


def test_wrong_ranks_are_rejected(capsys):
    with pytest.raises(SystemExit):
        bench.main(["--ranks", "two"])
    assert "expected whole numbers" in capsys.readouterr().err


def test_the_size_of_a_file_of_particles_is_known(capsys):
    """Positions, displacement and velocity have 24 bytes each, stress 32, two scalars and three numbers
    of a cell 8 each, in base64, and the lines of XML.
    """
    writing.main(["--cells", "8", "--repeat", "2"])
    lines = capsys.readouterr().out.splitlines()
    assert "256 particles" in lines
    (line,) = (line for line in lines if line.split()[0] == "particles")
    size, xml = 4 / 3 * (3 * 24 + 32 + 5 * 8), 2000 / 256
    assert size < float(line.split()[-2]) < size + xml


def test_a_folder_that_cannot_be_made_is_one_line(tmp_path):
    (tmp_path / "file").touch()
    run = python("-m", "cases.verification.cantilever", "--results", tmp_path / "file" / "below")
    assert run.returncode == 1
    assert run.stderr.splitlines()[-1].startswith("cantilever: result folder")
    assert "Traceback" not in run.stderr
