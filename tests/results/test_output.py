"""Results as files: complete, readable, and never half written."""

from __future__ import annotations

import csv
import subprocess
import sys

import meshio
import numpy as np
import pytest

import tawami
from cases.costs import writing
from cases.costs.bench import __main__ as bench
from cases.verification.cantilever import __main__ as study
from cases.verification.cantilever import mpm
from cases.verification.cantilever.beam import COLUMNS, SUPPORTS
from tawami.results.output import result_folder, whole_file, write_grid, write_particles


@pytest.fixture(scope="module")
def solution():
    return mpm.build("u_epsv", "exact", 4, alpha=0.1).solve()


def test_particles_as_vtu(solution, tmp_path):
    write_particles(tmp_path / "p.vtu", solution)
    mesh = meshio.read(tmp_path / "p.vtu")
    assert mesh.points.shape == (128, 3)
    np.testing.assert_array_equal(mesh.points[:, :2], solution.scene.particles.x)
    np.testing.assert_array_equal(mesh.point_data["stress xx yy zz xy [Pa]"], solution.stress)
    np.testing.assert_array_equal(mesh.point_data["mean stress [Pa]"], solution.mean_stress)
    np.testing.assert_array_equal(mesh.point_data["eps_v [-]"], solution.eps_v)
    u = mesh.point_data["displacement [m]"]
    np.testing.assert_array_equal(u[:, :2], solution.displacement_of_particles)
    assert not u[:, 2].any()


@pytest.mark.parametrize(
    ("form", "field"), [("u_epsv", "eps_v [-]"), ("u_p", "p [Pa]"), ("u", None)]
)
def test_grid_as_vtu(form, field, tmp_path):
    solution = mpm.build(form, "exact", 4).solve()
    write_grid(tmp_path / "g.vtu", solution)
    mesh = meshio.read(tmp_path / "g.vtu")
    assert mesh.points.shape == (9 * 5, 3)
    assert mesh.cells_dict["quad"].shape == (32, 4)
    assert (mesh.cell_data["particles [-]"][0] == 4).all()
    assert ({field} - {None}) == set(mesh.point_data) - {"displacement [m]"}
    for point, u in zip(mesh.points, mesh.point_data["displacement [m]"], strict=True):
        np.testing.assert_allclose(u[:2], solution.displacement(point[:2]), atol=1e-15)


def test_a_folder_that_cannot_be_written(tmp_path):
    occupied = tmp_path / "occupied"
    occupied.touch()
    for path in (occupied, occupied / "below"):
        with pytest.raises(tawami.OutputError, match="cannot be written .*: expected a folder"):
            result_folder(path)
    run = subprocess.run(
        [sys.executable, "-m", "cases.verification.cantilever", "--results", str(occupied / "below")],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert run.returncode == 1
    assert run.stderr.splitlines()[-1].startswith("cantilever: result folder")
    assert "Traceback" not in run.stderr


def test_a_file_is_whole_or_as_it_was(tmp_path):
    path = tmp_path / "table.csv"
    path.write_text("before")

    def interrupted():
        with whole_file(path) as part:
            part.write_text("half of what")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert path.read_text() == "before"
    assert list(tmp_path.iterdir()) == [path]
    with whole_file(path) as part:
        part.write_text("after")
    assert path.read_text() == "after"
    with (
        pytest.raises(tawami.OutputError, match="cannot be written"),
        whole_file(tmp_path / "no" / "x"),
    ):
        (tmp_path / "no" / "y").write_text("")


def test_a_name_that_is_not_vtu(solution, tmp_path):
    with pytest.raises(tawami.OutputError, match=r"p.xyz': expected a file name ending in .vtu"):
        write_particles(tmp_path / "p.xyz", solution)


def test_the_study_of_the_cantilever(tmp_path, capsys):
    """The main job, small: every method and support, table, figures, VTU, report."""
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
def test_wrong_cells_of_the_study(cells, capsys):
    with pytest.raises(SystemExit):
        study.main(["--cells", cells])
    assert "expected even numbers such as 2,4,8" in capsys.readouterr().err


def test_the_benchmark_prints_its_ratios(capsys, tmp_path):
    """Small, and without a look at the times themselves."""
    options = ["--cells", "4,8", "--per-axis", "2", "--threads", "1", "--ranks", "2"]
    bench.main([*options, "--results", str(tmp_path)])
    printed = capsys.readouterr().out
    for words in (
        "all but the factorisation: ", "particle stages: ", "FGMRES iterations [0, ",
        "us per particle and iteration", "reference over fast", "2 ranks: step ", "growth, ",
        "another set of active cells", "of them empty:", "BLAS",
    ):  # fmt: skip
        assert words in printed
    with (tmp_path / "bench.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [(row["assembly"], row["ranks"]) for row in rows[:3]] == [
        ("fast", "1"), ("reference", "1"), ("fast", "2")
    ]  # fmt: skip
    deflections = [float(row["deflection_m"]) for row in rows[:3]]
    assert deflections == pytest.approx([deflections[0]] * 3, rel=1e-10)
    assert all(float(row["peak_MB"]) > 10 for row in rows)


def test_wrong_numbers_for_the_benchmark(capsys):
    with pytest.raises(SystemExit):
        bench.main(["--ranks", "two"])
    assert "expected whole numbers" in capsys.readouterr().err


def test_what_writing_costs(capsys):
    """Sizes of raw files are known: x, displacement, velocity 24 bytes each, stress 32, two scalars 8
    each and the number of the point 4.
    """
    writing.main(["--cells", "8", "--repeat", "2"])
    lines = capsys.readouterr().out.splitlines()
    assert lines[1] == "256 particles"
    (raw,) = (line for line in lines if "particles, xdmf" in line)
    assert float(raw.split()[-1]) == 3 * 24 + 32 + 2 * 8 + 4
    assert len(lines) == 10
