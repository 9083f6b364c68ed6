"""One state of a scene as files: complete, readable, and never half written."""

from __future__ import annotations

import meshio
import numpy as np
import pytest

import tawami
from cases.verification.cantilever import mpm
from tawami.base.files import atomic_file, result_folder
from tawami.results.single import write_grid, write_particles


@pytest.fixture(scope="module")
def solution():
    return mpm.build("u_epsv", "exact", 4, alpha=0.1).solve()


def test_particles_are_written_as_vtu(solution, tmp_path):
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
def test_the_grid_is_written_as_vtu(form, field, tmp_path):
    solution = mpm.build(form, "exact", 4).solve()
    write_grid(tmp_path / "g.vtu", solution)
    mesh = meshio.read(tmp_path / "g.vtu")
    assert mesh.points.shape == (9 * 5, 3)
    assert mesh.cells_dict["quad"].shape == (32, 4)
    assert (mesh.cell_data["particles [-]"][0] == 4).all()
    assert ({field} - {None}) == set(mesh.point_data) - {"displacement [m]"}
    for point, u in zip(mesh.points, mesh.point_data["displacement [m]"], strict=True):
        np.testing.assert_allclose(u[:2], solution.displacement(point[:2]), atol=1e-15)


def test_a_folder_that_cannot_be_made_is_named(tmp_path):
    occupied = tmp_path / "occupied"
    occupied.touch()
    for path in (occupied, occupied / "below"):
        with pytest.raises(tawami.OutputError, match="cannot be written .*: expected a folder"):
            result_folder(path)


def test_an_interrupted_file_stays_as_it_was(tmp_path):
    path = tmp_path / "table.csv"
    path.write_text("before")

    def interrupted():
        with atomic_file(path) as part:
            part.write_text("half of what")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert path.read_text() == "before"
    assert list(tmp_path.iterdir()) == [path]
    with atomic_file(path) as part:
        part.write_text("after")
    assert path.read_text() == "after"
    with (
        pytest.raises(tawami.OutputError, match="cannot be written"),
        atomic_file(tmp_path / "no" / "x"),
    ):
        (tmp_path / "no" / "y").write_text("")


def test_another_file_name_than_vtu_is_rejected(solution, tmp_path):
    with pytest.raises(tawami.OutputError, match=r"p.xyz': expected a file name ending in .vtu"):
        write_particles(tmp_path / "p.xyz", solution)
