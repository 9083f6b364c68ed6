"""Ranks without particles, and cells that change their rank: the results of one rank."""

from __future__ import annotations

import json
from pathlib import Path

import empty_ranks
import meshio
import numpy as np
import pytest
from programs import on_ranks

from tawami.results import plot

pytestmark = [pytest.mark.mpi, pytest.mark.direct]  # the ranks have the solver by default


@pytest.fixture(scope="module")
def alone(tmp_path_factory) -> tuple[Path, dict[str, np.ndarray]]:
    folder = tmp_path_factory.mktemp("alone")
    return folder, empty_ranks.all_of(folder)


def tables(folder: Path) -> dict[str, np.ndarray]:
    files = sorted(folder.rglob("table.csv"))
    return {f"{f.relative_to(folder)}": np.loadtxt(f, delimiter=",", skiprows=1) for f in files}


@pytest.mark.parametrize("number", [2, pytest.param(4, marks=pytest.mark.slow)])
def test_outputs_quantities_and_checkpoints_are_those_of_one_rank(alone, number, tmp_path):
    run = on_ranks(number, "tests/processes/empty_ranks.py", tmp_path)
    assert run.returncode == 0, run.stderr
    expected, found = alone[1], dict(np.load(tmp_path / "found.npz"))
    first, last = found.pop("counts")
    assert first.max() == 16 / number  # the body has four cells
    assert last.max() <= 1.5 * 16 / number  # and has moved by 16, which another rank had
    assert 0 in found.pop("static counts")  # of a body of one cell
    assert 0 < expected["left"][0] < 16
    assert (found.pop("rows") <= np.ceil(expected["rows"] / number)).all()  # of a file of the grid
    for name, values in found.items():
        close(values, expected[name], name)
    rows = tables(tmp_path)
    assert len(rows) == 3
    for name, values in tables(alone[0]).items():
        close(rows[name], values, name)
    files = sorted(path.relative_to(alone[0]) for path in alone[0].rglob("*.vtu"))
    assert sorted(path.relative_to(tmp_path) for path in tmp_path.rglob("*.vtu")) == files
    for path in files:
        if "-00000" not in path.name or path.name.endswith("4.vtu"):
            one, several = meshio.read(alone[0] / path), meshio.read(tmp_path / path)
            close(several.points, one.points, f"{path}")
            assert np.array_equal(several.cells[0].data, one.cells[0].data), path
            if one.cells[0].type == "quad":
                assert np.array_equal(several.points, one.points), path
            for name, data in one.point_data.items():
                close(several.point_data[name], data, f"{path}: {name}")
            for name, blocks in one.cell_data.items():
                close(several.cell_data[name][0], blocks[0], f"{path}: {name}")
    with np.load(alone[0] / "state.npz") as one, np.load(tmp_path / "state.npz") as several:
        assert several.files == one.files
        for name in one.files:
            if name != "about.json" and not name.startswith("work"):  # cells of the ranks
                close(several[name], one[name], name)
    pictures = plot.plot(tmp_path / "slide", movie=None)
    assert pictures
    assert all(path.stat().st_size for path in pictures)
    assert json.loads((tmp_path / "slide" / "run.json").read_text())


def close(found: np.ndarray, expected: np.ndarray, name: str) -> None:
    found, expected = np.asarray(found, dtype=float), np.asarray(expected, dtype=float)
    assert found.shape == expected.shape, name
    assert (np.isnan(found) == np.isnan(expected)).all(), name
    size = np.abs(np.nan_to_num(expected)).max(initial=1e-300)
    error = np.abs(np.nan_to_num(found) - np.nan_to_num(expected)).max(initial=0.0)
    assert error <= 1e-7 * size, (name, error, size)
