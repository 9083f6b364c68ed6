"""Files of outputs, compared with the particles of the run and with balances of force and moment."""

from __future__ import annotations

from dataclasses import fields

import meshio
import numpy as np
import pytest
from mpi4py import MPI
from readers import pvd, table
from runs import drive, look, plastic_block, static_scene

import tawami
from tawami.motion.energy import Energies

FIELDS = (
    "displacement", "stress", "mean stress", "deviatoric stress q", "volume", "eps_v", "velocity",
    "acceleration", "material", "number", "plastic_strain",
)  # fmt: skip


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """A run that writes every quantity, and the state of its particles in each step."""
    folder, kept = tmp_path_factory.mktemp("series"), []

    def seen(motion, solution, step):
        p = motion.scene.particles
        names = ("x", "displacement", "stress", "volume", "eps_v", "material", "number")
        now = {name: np.array(getattr(p, name)) for name in names}
        now |= {"velocity": np.array(motion.velocity), "time": motion.time,
                "acceleration": np.array(motion.acceleration), "energies": motion.energies,
                "plastic_strain": np.array(p.history("plastic_strain")),
                "solution": solution}  # fmt: skip
        kept.append(now)

    motion = plastic_block()
    outputs = [
        tawami.ParticleOutput(*FIELDS, every_steps=2),
        tawami.ParticleOutput(*FIELDS, every_steps=2, name="raw"),
        tawami.GridOutput("velocity", "particles", every_steps=5),
        tawami.TableOutput(
            "energies", "reaction bottom", "run-out", "momentum", "angular momentum", "particles",
            "displacement (0.0, 1.25)", "Newton iterations", "step size",
        ),
    ]  # fmt: skip
    drive(motion, outputs, folder, 25, seen=seen)
    return folder, kept


def test_particles_are_written_as_a_series_of_vtu(written):
    folder, kept = written
    series = pvd(folder / "particles.pvd")
    assert [time for time, _ in series] == [kept[k]["time"] for k in [*range(0, 25, 2), 25]]
    assert sorted(path for _, path in series) == sorted((folder / "particles").iterdir())
    now, mesh = kept[25], meshio.read(series[-1][1])
    np.testing.assert_array_equal(mesh.points[:, :2], now["x"])
    found = mesh.point_data
    stress = now["stress"]
    tensors = np.zeros((len(stress), 3, 3))
    tensors[:, [0, 1, 2, 0, 1], [0, 1, 2, 1, 0]] = stress[:, [0, 1, 2, 3, 3]]
    s = tensors - np.trace(tensors, axis1=1, axis2=2)[:, None, None] / 3 * np.eye(3)
    expected = {
        "displacement [m]": now["displacement"], "velocity [m/s]": now["velocity"],
        "acceleration [m/s2]": now["acceleration"], "stress xx yy zz xy [Pa]": stress,
        "mean stress [Pa]": np.trace(tensors, axis1=1, axis2=2) / 3,
        "deviatoric stress q [Pa]": np.sqrt(1.5) * np.linalg.norm(s, axis=(1, 2)),
        "volume [m2 per m]": now["volume"], "eps_v [-]": now["eps_v"],
        "material [-]": now["material"], "number [-]": np.arange(len(stress)),
        "plastic_strain [-]": now["plastic_strain"],
    }  # fmt: skip
    assert set(found) == set(expected)
    assert np.ptp(now["plastic_strain"]) > 0
    for name, values in expected.items():
        given = found[name][:, :2] if values.ndim == 2 and values.shape[1] == 2 else found[name]
        np.testing.assert_allclose(given, values, rtol=1e-14, err_msg=name)


def test_a_table_has_a_row_for_each_step(written):
    folder, kept = written
    found = table(folder / "table.csv")
    times = np.array([now["time"] for now in kept])
    np.testing.assert_array_equal(found["step [-]"], np.arange(26))
    np.testing.assert_array_equal(found["time [s]"], times)
    np.testing.assert_allclose(found["step size [s]"], np.diff(times, prepend=0.0), atol=1e-15)
    for name in (field.name for field in fields(Energies)):
        values = [getattr(now["energies"], name) for now in kept]
        np.testing.assert_array_equal(found[f"energy {name} [J/m]"], values)
    assert np.isnan(found["reaction bottom y [N/m]"][0])
    iterations = [0] + [now["solution"].iterations for now in kept[1:]]
    np.testing.assert_array_equal(found["Newton iterations [-]"], iterations)
    np.testing.assert_array_equal(found["run-out [m]"], [now["x"][:, 0].max() for now in kept])
    given = [now["solution"].reaction("bottom")[1] for now in kept[1:]]
    np.testing.assert_array_equal(found["reaction bottom y [N/m]"][1:], given)
    momentum = [now["volume"] @ now["velocity"] for now in kept]  # the density is 1
    for k, axis in enumerate("xy"):
        name = f"momentum {axis} [kg m/s per m]"
        np.testing.assert_allclose(found[name], np.array(momentum)[:, k], rtol=1e-12)
    np.testing.assert_array_equal(found["particles [-]"], 36)


def test_the_displacement_of_a_point_follows_the_body(tmp_path):
    """The upper right corner, without a particle, of a block that flies and spins."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(-1.0, -1.0), h=0.25, cells=(8, 8))
    body = tawami.box(grid, (-0.5, -0.5), (0.5, 0.5), per_axis=2)
    law = tawami.linear_elastic(E=1e4, nu=0.3)
    scene = tawami.Scene(grid, body, law, form="u_finite", density=1.0)
    spin, velocity = 2.0, np.array([0.2, -0.1])
    start = spin * body.x[:, ::-1] * [-1, 1] + velocity
    motion = tawami.Dynamics(scene, velocity=start)
    output = tawami.TableOutput("displacement (0.5, 0.5)", "angular momentum", "momentum")
    drive(motion, [output], tmp_path, 20, dt=0.005)
    found = table(tmp_path / "table.csv")
    angle = np.arctan(spin * 0.1)  # but for centrifugal forces, which stretch it by 1e-4
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    expected = turn @ [0.5, 0.5] - [0.5, 0.5] + 0.1 * velocity
    u = [found[f"displacement (0.5, 0.5) {axis} [m]"][-1] for axis in "xy"]
    np.testing.assert_allclose(u, expected, atol=3e-3)
    assert np.linalg.norm(u) > 0.1
    particles = 0.25**2 / 4 * (body.x**2).sum() * spin
    np.testing.assert_allclose(found["angular momentum [kg m2/s per m]"][0], particles)
    np.testing.assert_allclose(found["momentum x [kg m/s per m]"], 0.2)


def test_velocities_on_the_grid_are_exact_near_the_body(written):
    """A constant is reproduced; vertices away from the body hold NaN."""
    folder, kept = written
    series = pvd(folder / "grid.pvd")
    assert [time for time, _ in series] == [kept[k]["time"] for k in range(0, 26, 5)]
    mesh = meshio.read(series[0][1])
    v, count = mesh.point_data["velocity [m/s]"], mesh.cell_data["particles [-]"][0]
    near = np.unique(mesh.cells_dict["quad"][count > 0])
    np.testing.assert_allclose(v[near, :2], np.tile([0.3, -1.5], (len(near), 1)), rtol=1e-12)
    away = np.setdiff1d(np.arange(len(v)), near)
    assert len(away)
    assert np.isnan(v[away, :2]).all()
    assert count.sum() == 36


def test_only_requested_quantities_are_written(tmp_path):
    drive(
        plastic_block(),
        [tawami.GridOutput("mean stress"), tawami.TableOutput("run-out")],
        tmp_path,
        1,
    )
    mesh = meshio.read(pvd(tmp_path / "grid.pvd")[-1][1])
    assert (set(mesh.point_data), set(mesh.cell_data)) == ({"mean stress [Pa]"}, set())
    assert set(table(tmp_path / "table.csv")) == {"step [-]", "time [s]", "run-out [m]"}
    assert {path.name for path in tmp_path.iterdir()} == {"grid", "grid.pvd", "table.csv"}


def test_the_default_quantities_are_those_of_the_scene(tmp_path):
    outputs = [tawami.ParticleOutput(), tawami.GridOutput(), tawami.TableOutput()]
    drive(plastic_block(), outputs, tmp_path, 1)
    mesh = meshio.read(pvd(tmp_path / "particles.pvd")[-1][1])
    assert set(mesh.point_data) == {
        "displacement [m]", "stress xx yy zz xy [Pa]", "mean stress [Pa]", "eps_v [-]",
        "velocity [m/s]", "plastic_strain [-]",
    }  # fmt: skip
    mesh = meshio.read(pvd(tmp_path / "grid.pvd")[-1][1])
    assert {*mesh.point_data, *mesh.cell_data} == {"displacement [m]", "eps_v [-]", "particles [-]"}
    assert "energy kinetic [J/m]" in table(tmp_path / "table.csv")


def test_reactions_balance_the_loads(tmp_path):
    """In force and moment, in each step of a ramp, although splines are not at the vertices."""
    scene = static_scene()
    grid_output = tawami.GridOutput("reaction", "displacement")
    names = ("reaction left", "reaction (0, 0.5)", "displacement (2, 0.5)", "step size")
    outputs = [grid_output, tawami.TableOutput(*names)]
    for output in outputs:
        output.begin(tmp_path, scene, None)
        look(output, scene, None, None, 0.0, 0, last=False)
    parts = []

    def each(solution):
        parts.append(solution)
        for output in outputs:
            part = len(parts) / 4
            look(output, scene, None, solution, part, len(parts), last=part == 1.0)

    tawami.ramp(scene, 0.25, each=each)
    series = pvd(tmp_path / "grid.pvd")
    assert [time for time, _ in series] == [0.0, 0.25, 0.5, 0.75, 1.0]
    assert np.isnan(meshio.read(series[0][1]).point_data["reaction [N/m]"][:, :2]).all()
    for part, path in series[1:]:
        mesh = meshio.read(path)
        f, x = mesh.point_data["reaction [N/m]"], mesh.points
        np.testing.assert_allclose(f[:, :2].sum(axis=0), [-3 * part, 1 * part], rtol=1e-9)
        moment = (x[:, 0] * f[:, 1] - x[:, 1] * f[:, 0]).sum()  # of tractions about (0, 0)
        np.testing.assert_allclose(moment, -part * (2.0 * -1.0 - 0.5 * 3.0), rtol=1e-9)
        assert not f[x[:, 0] > 0.3].any()
    found = table(tmp_path / "table.csv")
    np.testing.assert_allclose(found["reaction left x [N/m]"][1:], [-0.75, -1.5, -2.25, -3])
    np.testing.assert_allclose(found["reaction (0, 0.5) y [N/m]"][1:], [0.25, 0.5, 0.75, 1])
    u = [part.displacement((2, 0.5))[1] for part in parts]
    np.testing.assert_allclose(found["displacement (2, 0.5) y [m]"], [0, *u], rtol=1e-12)
    np.testing.assert_allclose(found["step size [-]"], [0, 0.25, 0.25, 0.25, 0.25])
    np.testing.assert_allclose(found["pseudo-time [-]"], [0, 0.25, 0.5, 0.75, 1.0])


P, G, T = tawami.ParticleOutput, tawami.GridOutput, tawami.TableOutput
