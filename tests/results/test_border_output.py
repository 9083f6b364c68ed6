"""The border of a body as a series, and in pictures."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

import tawami
from tawami.results.series import frames


def bent(form):
    """A beam off the lines of the grid, clamped at its root, under a pressure."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=0.25, cells=(12, 6))
    corners = [(0.05, 0.3), (2.6, 0.3), (2.3, 1.1), (0.05, 1.1)]
    names = ["below", "tip", "above", "root"]
    beam = tawami.polygon(grid, corners, gauss=True, names=names)
    law = tawami.linear_elastic(E=1e6, nu=0.3)
    scene = tawami.Scene(grid, beam, law, form=form, ghost_penalty="on")
    scene.fix("root", "x")
    scene.fix("root", "y")
    scene.pressure("above", 200.0)
    return scene


@pytest.mark.parametrize("form", ["u_epsv", "u_epsv_finite"])
def test_tractions_of_a_border_in_a_file_balance(form, tmp_path):
    """Load and support are integrals of the tractions in the file; the reaction is that of the table."""
    scene = bent(form)
    results = tawami.Results(
        tmp_path / "run", tawami.ParticleOutput("stress"), tawami.BorderOutput(),
        tawami.TableOutput("reaction root"), progress=False,
    )  # fmt: skip
    tawami.ramp(scene, 0.5, results=results)
    series = frames(tmp_path / "run" / "ramp" / "border.pvd")
    assert [time for time, _ in series] == [0.0, 0.5, 1.0]
    frame = series[-1][1]()
    assert frame.kind == "line"
    area = frame.on_cells["area [m2 per m]"][:, None]
    forces = {
        name: (area * frame.on_cells["traction [Pa]"])[frame.on_cells["part [-]"] == k].sum(axis=0)
        for k, name in enumerate(scene.border.names)
    }
    assert forces["below"] == pytest.approx(0.0)
    assert forces["above"] + forces["root"] == pytest.approx(0.0, abs=1e-3 * 450)
    assert forces["above"][1] == pytest.approx(-450.0, rel=1e-2)
    last = (tmp_path / "run" / "ramp" / "table.csv").read_text().splitlines()[-1]
    assert float(last.split(",")[3]) == pytest.approx(forces["root"][1], rel=1e-3)
    # the lines move by their displacements at finite strain
    ends = frame.points[frame.cells]
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    assert length == pytest.approx(area[:, 0], rel=1e-9)
    assert tawami.plot(tmp_path / "run", movie=None)


def test_the_outline_of_a_solution_moves_with_the_body():
    solution = bent("u_epsv").solve()
    drawn = [solution.plot(deformed=factor).collections for factor in (0.0, 1.0)]
    assert [len(collections) for collections in drawn] == [2, 2]  # particles and border
    start, end = (np.array(border.get_segments()) for _, border in drawn)
    tip = np.argmax(start[:, :, 0].max(axis=1))
    middle = start[tip].mean(axis=0)
    inside = middle - np.array([1e-6, 0.0])
    moved = end[tip].mean(axis=0) - middle
    assert moved == pytest.approx(solution.displacement(inside), rel=1e-4)


def test_a_body_without_a_border_has_no_series(tmp_path):
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=0.5, cells=(2, 2))
    box = tawami.box(grid, (0, 0), (1, 1))
    scene = tawami.Scene(
        grid, tawami.Body(box.x, box.volume), tawami.linear_elastic(E=1e6, nu=0.3), density=1.0
    )
    scene.fix("bottom", "x")
    scene.fix("bottom", "y")
    assert len(scene.solve().plot().collections) == 1  # particles
    scene.gravity((0.0, -10.0))
    with pytest.raises(tawami.NotModelledError, match="'border' needs a body with a border"):
        tawami.ramp(scene, 1.0, results=tawami.Results(tmp_path / "run", tawami.BorderOutput()))
