"""What a run writes in time: when, what, how it is read, and what is left of it when it is cut short."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from xml.etree import ElementTree

import meshio
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mpi4py import MPI
from programs import small_files
from test_ranks import start

import tawami
from tawami.motion.energy import Energies
from tawami.motion.observer import Snapshot
from tawami.results.output import Output

STEEL = {"yield_stress": 20.0, "hardening": 10.0}


def block(**options) -> tawami.Dynamics:
    """A plastic block on a floor that it strikes; particles in an order of their own."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(-1.0, 0.5), h=0.25, cells=(6, 5))
    body = tawami.box(grid, (-0.75, 0.5), (0.0, 1.25))
    order = np.random.default_rng(0).permutation(len(body.x))
    body = tawami.Body(body.x[order], body.volume[order])
    law = tawami.von_mises(tawami.linear_elastic(E=1e3, nu=0.3), **STEEL)
    scene = tawami.Scene(grid, body, law, form="u_epsv_finite", density=1.0, **options)
    scene.fix("bottom", "y")
    scene.gravity((0.0, -10.0))
    return tawami.Dynamics(scene, velocity=(0.3, -1.5))


def drive(motion, outputs, folder, steps, *, first=0, dt=0.004, states=None, seen=None):
    """What results.py does: a phase from a step on; the last of `steps` is its end."""
    for k, output in enumerate(outputs):
        output.begin(folder, motion, None if states is None else states[k])
    for step in range(first, steps + 1):
        solution = None if step == 0 else motion.step(dt)
        if seen is not None:
            seen(motion, solution, step)
        for output in outputs:
            output.look(Snapshot(motion, solution, motion.time, step, step == steps))


def pvd(path: Path) -> list[tuple[float, Path]]:
    entries = ElementTree.parse(path).getroot().findall("Collection/DataSet")
    return [(float(e.attrib["timestep"]), path.parent / e.attrib["file"]) for e in entries]


def xdmf(path: Path) -> list[tuple[float, dict[str, np.ndarray]]]:
    """XDMF as its specification has it, written once more here."""
    found = []
    for grid in ElementTree.parse(path).getroot().findall("./Domain/Grid/Grid"):
        arrays = {}
        for child in grid:
            item = child.find("DataItem")
            if item is None:
                continue
            assert (item.attrib["Format"], item.attrib["Endian"]) == ("Binary", "Little")
            kind = {"Float": "f", "Int": "i", "UInt": "u"}[item.attrib["DataType"]]
            raw = (path.parent / item.text).read_bytes()[int(item.attrib["Seek"]) :]
            shape = tuple(map(int, item.attrib["Dimensions"].split()))
            values = np.frombuffer(raw, f"<{kind}{item.attrib['Precision']}", np.prod(shape))
            arrays[child.get("Name") or child.tag] = values.reshape(shape)
        found.append((float(grid.find("Time").attrib["Value"]), arrays))
    return found


def table(path: Path) -> dict[str, np.ndarray]:
    with path.open(newline="") as file:
        head, *rows = csv.reader(file)
    return dict(zip(head, np.array(rows, dtype=float).T, strict=True))


# -- when --------------------------------------------------------------------


class Recorder(Output):
    """Writes nothing, keeps when."""

    def __init__(self, **when):
        super().__init__((), when.get("every"), when.get("every_steps"), "recorder")
        self.times = []

    def _resolve(self, subject):
        pass

    def _open(self, folder, last, subject):
        pass

    def _write(self, moment, size):
        self.times.append(moment.time)


@pytest.fixture(scope="module")
def scene():
    return block().scene


def look(recorder, scene, times, state=None, first=0):
    recorder.begin(Path(), scene, state)
    for step in range(first, len(times)):
        moment = Snapshot(scene, None, times[step], step, step == len(times) - 1)
        recorder.look(moment)


@given(
    every=st.sampled_from([0.1, 0.25, 1.0, 3.0]),
    sizes=st.lists(st.sampled_from([0.1, 0.05, 1 / 3, 0.7, 2.0]), min_size=1, max_size=40),
    cut=st.integers(0, 40),
)
def test_the_first_step_at_or_after_each_multiple(scene, every, sizes, cut):
    times = [0.0, *np.cumsum(sizes)]
    wanted = {0.0, times[-1]}
    for multiple in np.arange(1, times[-1] / every + 1) * every:
        wanted |= set([t for t in times if t > multiple - 1e-9][:1])
    whole, cut = Recorder(every=every), min(cut, len(sizes))
    look(whole, scene, times)
    assert whole.times == sorted(wanted)
    # stopped after some step and gone on with
    first, second = Recorder(every=every), Recorder(every=every)
    first.begin(Path(), scene, None)
    for step in range(cut + 1):
        first.look(Snapshot(scene, None, times[step], step, last=False))
    look(second, scene, times, json.loads(json.dumps(first.state())), first=cut)
    assert sorted(first.times + second.times) == sorted(wanted)


def test_every_so_many_steps_and_the_last(scene):
    times = [0.1 * k for k in range(8)]
    for when, steps in (({"every_steps": 3}, [0, 3, 6, 7]), ({}, range(8))):
        recorder = Recorder(**when)
        look(recorder, scene, times)
        assert recorder.times == [times[k] for k in steps]


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda: tawami.ParticleOutput(every=0.0), r"every = 0.0: expected a finite number above 0"),
        (lambda: tawami.ParticleOutput(every_steps=0), r"every_steps = 0: expected a whole number, at"),
        (lambda: tawami.TableOutput(every=1.0, every_steps=1), "both given: expected one of them"),
        (lambda: tawami.GridOutput(format="hdf5"), "format = 'hdf5': expected 'vtu' or 'xdmf'"),
        (lambda: tawami.GridOutput(projection="l2"), "projection = 'l2': expected 'lumped' or '"),
        (lambda: tawami.TableOutput(3), r"TableOutput\(3,\): expected names of quantities"),
        (lambda: tawami.TableOutput(name="a/b"), "name = 'a/b': expected the name of a file without"),
    ],
)  # fmt: skip
def test_wrong_requests(make, sentence):
    with pytest.raises(tawami.InputError, match=sentence):
        make()


# -- what --------------------------------------------------------------------

FIELDS = (
    "displacement", "stress", "mean stress", "deviatoric stress q", "volume", "eps_v", "velocity",
    "acceleration", "material", "number", "plastic_strain",
)  # fmt: skip


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """A run with everything asked for, and what its particles were at each step."""
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

    motion = block()
    outputs = [
        tawami.ParticleOutput(*FIELDS, every_steps=2),
        tawami.ParticleOutput(*FIELDS, every_steps=2, format="xdmf", name="raw"),
        tawami.GridOutput("velocity", "particles", every_steps=5),
        tawami.TableOutput(
            "energies", "reaction bottom", "run-out", "momentum", "angular momentum", "particles",
            "displacement (0.0, 1.25)", "Newton iterations", "step size",
        ),
    ]  # fmt: skip
    drive(motion, outputs, folder, 25, seen=seen)
    return folder, kept


def test_particles_as_a_series_of_vtu(written):
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


def test_xdmf_holds_the_same(written):
    folder, _ = written
    series, raw = pvd(folder / "particles.pvd"), xdmf(folder / "raw.xdmf")
    assert [time for time, _ in series] == [time for time, _ in raw]
    for (_, path), (_, arrays) in zip(series, raw, strict=True):
        mesh = meshio.read(path)
        np.testing.assert_array_equal(arrays.pop("Geometry"), mesh.points)
        np.testing.assert_array_equal(arrays.pop("Topology"), mesh.cells_dict["vertex"])
        for k, component in enumerate(("xx", "yy", "zz", "xy")):
            np.testing.assert_array_equal(
                arrays.pop(f"stress {component} [Pa]"),
                mesh.point_data["stress xx yy zz xy [Pa]"][:, k],
            )
        assert set(arrays) == set(mesh.point_data) - {"stress xx yy zz xy [Pa]"}
        for name, values in arrays.items():
            np.testing.assert_array_equal(values, mesh.point_data[name])


def test_the_table(written):
    folder, kept = written
    found = table(folder / "table.csv")
    times = np.array([now["time"] for now in kept])
    np.testing.assert_array_equal(found["step [-]"], np.arange(26))
    np.testing.assert_array_equal(found["time [s]"], times)
    np.testing.assert_allclose(found["step size [s]"], np.diff(times, prepend=0.0), atol=1e-15)
    for name in Energies.__dataclass_fields__:
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


def test_the_displacement_of_a_point_that_moves(tmp_path):
    """A block that flies along a line and turns: its upper right corner, where no particle is."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(-1.0, -1.0), h=0.25, cells=(8, 8))
    body = tawami.box(grid, (-0.5, -0.5), (0.5, 0.5))
    law = tawami.linear_elastic(E=1e4, nu=0.3)
    scene = tawami.Scene(grid, body, law, form="u_finite", density=1.0)
    spin, velocity = 2.0, np.array([0.2, -0.1])
    start = spin * body.x[:, ::-1] * [-1, 1] + velocity
    motion = tawami.Dynamics(scene, velocity=start)
    output = tawami.TableOutput("displacement (0.5, 0.5)", "angular momentum", "momentum")
    drive(motion, [output], tmp_path, 20, dt=0.005)
    found = table(tmp_path / "table.csv")
    angle = np.arctan(spin * 0.1)  # nearly: centrifugal forces stretch it by 1e-4
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    expected = turn @ [0.5, 0.5] - [0.5, 0.5] + 0.1 * velocity
    u = [found[f"displacement (0.5, 0.5) {axis} [m]"][-1] for axis in "xy"]
    np.testing.assert_allclose(u, expected, atol=3e-3)
    assert np.linalg.norm(u) > 0.1
    particles = 0.25**2 / 4 * (body.x**2).sum() * spin
    np.testing.assert_allclose(found["angular momentum [kg m2/s per m]"][0], particles)
    np.testing.assert_allclose(found["momentum x [kg m/s per m]"], 0.2)


def test_velocities_on_the_grid(written):
    """Constants stay, and away from the body nothing is known."""
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


def test_only_what_was_asked_for(tmp_path):
    drive(block(), [tawami.GridOutput("mean stress"), tawami.TableOutput("run-out")], tmp_path, 1)
    mesh = meshio.read(pvd(tmp_path / "grid.pvd")[-1][1])
    assert (set(mesh.point_data), set(mesh.cell_data)) == ({"mean stress [Pa]"}, set())
    assert set(table(tmp_path / "table.csv")) == {"step [-]", "time [s]", "run-out [m]"}
    assert {path.name for path in tmp_path.iterdir()} == {"grid", "grid.pvd", "table.csv"}


def test_the_usual_is_what_the_scene_has(tmp_path):
    outputs = [tawami.ParticleOutput(), tawami.GridOutput(), tawami.TableOutput()]
    drive(block(), outputs, tmp_path, 1)
    mesh = meshio.read(pvd(tmp_path / "particles.pvd")[-1][1])
    assert set(mesh.point_data) == {
        "displacement [m]", "stress xx yy zz xy [Pa]", "mean stress [Pa]", "eps_v [-]",
        "velocity [m/s]", "plastic_strain [-]",
    }  # fmt: skip
    mesh = meshio.read(pvd(tmp_path / "grid.pvd")[-1][1])
    assert {*mesh.point_data, *mesh.cell_data} == {"displacement [m]", "eps_v [-]", "particles [-]"}
    assert "energy kinetic [J/m]" in table(tmp_path / "table.csv")


def static(form="u_epsv", **options) -> tawami.Scene:
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0.0, 0.0), h=0.25, cells=(8, 5))
    body = tawami.box(grid, (0.0, 0.0), (2.0, 1.0))
    scene = tawami.Scene(grid, body, tawami.linear_elastic(E=1e3, nu=0.3), form=form, **options)
    scene.fix("left", "x")
    scene.hold((0.0, 0.5), "y")
    scene.traction("right", (3.0, -1.0))
    return scene


def test_reactions_at_the_vertices_balance_the_loads(tmp_path):
    """Force and moment, though splines are not at the vertices; at small strain, in a ramp."""
    scene = static()
    grid_output = tawami.GridOutput("reaction", "displacement")
    names = ("reaction left", "reaction (0, 0.5)", "displacement (2, 0.5)", "step size")
    outputs = [grid_output, tawami.TableOutput(*names)]
    for output in outputs:
        output.begin(tmp_path, scene, None)
        output.look(Snapshot(scene, None, 0.0, 0, last=False))
    parts = []

    def each(solution):
        parts.append(solution)
        for output in outputs:
            part = len(parts) / 4
            output.look(Snapshot(scene, solution, part, len(parts), last=part == 1.0))

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


@pytest.mark.parametrize(
    ("output", "sentence"),
    [
        (P("velocity"), r"velocity: a scene by itself is static.*Dynamics\(scene, velocity"),
        (P("plastic_strain"), r"'plastic_strain': the laws of this scene have none: .*von_mises"),
        (P("eps_v"), r"eps_v: .*expected one with.*form='u_epsv'"),
        (G("velocity"), r"velocity: a scene by itself is static"),
        (G("mean stress", "dilatancy"), "'dilatancy': the laws of this scene have none"),
        (G("eps_v"), r"eps_v: .*form='u_epsv'"),
        (G("p"), r"p: form 'u' has no pressure: expected form='u_p'"),
        (T("energies"), r"energies: a scene by itself is static"),
        (T("momentum"), r"momentum needs a velocity: a scene by itself is static"),
    ],
)
def test_what_a_scene_does_not_model_names_the_switch(output, sentence, tmp_path):
    with pytest.raises(tawami.NotModelledError, match=sentence):
        output.begin(tmp_path, static("u"), None)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("output", "sentence"),
    [
        (P("strss"), "particles: 'strss' is unknown: expected one of displacement, stress, mean str"),
        (G("number"), "grid: 'number' is unknown: expected one of displacement, velocity, reaction"),
        (T("energy"), "table: 'energy' is unknown: expected one of energies, momentum"),
        (T("reaction top"), r"reaction\('top'\): nothing supports that edge: expected one of left"),
        (T("reaction (1, 1)"), r"reaction \(1, 1\): no point is held there: expected hold\(\(1.0, 1"),
        (T("displacement (9, 0)"), r"displacement \(9, 0\): expected a point within the grid"),
        (T("displacement here"), r"displacement here: expected a point as \(2, 0\) after the name"),
    ],
)  # fmt: skip
def test_unknown_names_list_the_known(output, sentence, tmp_path):
    with pytest.raises(tawami.InputError, match=sentence):
        output.begin(tmp_path, static(), None)


def test_a_point_away_from_a_body_that_moves(tmp_path):
    with pytest.raises(tawami.InputError, match="no particle was within a cell of it, 0.25 m: exp"):
        T("displacement (0.45, 1.7)").begin(tmp_path, block().scene, None)


# -- runs that are cut short -------------------------------------------------


def all_outputs():
    return [
        tawami.ParticleOutput("velocity", "stress", every=0.009),
        tawami.ParticleOutput("velocity", every_steps=3, format="xdmf", name="raw"),
        tawami.GridOutput("mean stress", every_steps=4),
        tawami.TableOutput("energies", "step size", "reaction bottom"),
    ]


def contents(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def test_a_run_that_goes_on_leaves_the_same_files(tmp_path):
    whole, cut = tmp_path / "whole", tmp_path / "cut"
    drive(block(), all_outputs(), whole, 12)
    motion, outputs, states = block(), all_outputs(), []

    def checkpoint(motion, solution, step):
        if step == 7:  # the state after step 6
            states.extend(json.loads(json.dumps([output.state() for output in outputs])))

    # it runs on to step 10 after the checkpoint, and is killed while a file and a row are written
    drive(motion, outputs, cut, 10, seen=checkpoint)
    (cut / "particles" / ".1234-particles-000011.vtu").write_bytes(b"<VTK")
    with (cut / "table.csv").open("a") as file:
        file.write("11,0.04")
    again, resumed = block(), all_outputs()
    for _ in range(6):
        again.step(0.004)
    drive(again, resumed, cut, 12, first=7, states=states)
    left = contents(cut)
    left.pop("particles/.1234-particles-000011.vtu")
    assert left == contents(whole)


def test_what_is_later_than_the_checkpoint_goes_at_once(tmp_path):
    output = tawami.ParticleOutput("velocity")
    motion = block()
    drive(motion, [output], tmp_path, 3)
    state = output.state()
    drive(motion, [tawami.ParticleOutput("velocity")], tmp_path, 5, first=4, states=[state])
    tawami.ParticleOutput("velocity").begin(tmp_path, motion, state)
    names = [path.name for _, path in pvd(tmp_path / "particles.pvd")]
    assert names == [f"particles-{k:06d}.vtu" for k in range(4)]
    assert sorted(path.name for path in (tmp_path / "particles").iterdir()) == names
    tawami.ParticleOutput("velocity").begin(tmp_path, motion, None)
    assert pvd(tmp_path / "particles.pvd") == []
    assert not list((tmp_path / "particles").iterdir())


def test_a_table_that_goes_on_has_the_same_columns(tmp_path):
    output = tawami.TableOutput("run-out")
    motion = block()
    drive(motion, [output], tmp_path, 2)
    before = (tmp_path / "table.csv").read_text()
    with pytest.raises(
        tawami.InputError, match=r"run-out \[m\], and .*momentum y .* are asked for"
    ):
        T("momentum").begin(tmp_path, motion, output.state())
    assert (tmp_path / "table.csv").read_text() == before


def test_an_index_that_is_none(tmp_path):
    (tmp_path / "particles.pvd").write_text("<VTKFile><Coll")
    motion = block()
    with pytest.raises(
        tawami.OutputError, match=r"particles.pvd' cannot be read .*remove it to beg"
    ):
        P("velocity").begin(tmp_path, motion, {"seen": 3, "written": 3, "time": 0.1})


@pytest.mark.parametrize(
    ("output", "room"),
    [
        (lambda: tawami.ParticleOutput("velocity", "stress"), 3_000),
        (lambda: tawami.ParticleOutput("velocity", "stress", format="xdmf"), 1_000),
        # the files fit, their index does not
        (lambda: tawami.GridOutput("particles", format="xdmf"), 4_000),
        (lambda: tawami.TableOutput("energies"), 900),
    ],
)
def test_a_full_disk_stops_with_a_sentence_and_keeps_the_series(output, room, tmp_path):
    motion, writer = block(), output()
    drive(motion, [writer], tmp_path, 2)
    before = contents(tmp_path)
    moments = []

    def on():
        for step in range(3, 30):
            moments.append(step)
            solution = motion.step(0.004)
            writer.look(Snapshot(motion, solution, motion.time, step, last=False))

    with (
        small_files(room),
        pytest.raises(tawami.OutputError, match=r"cannot be written: File too la"),
    ):
        on()
    after = contents(tmp_path)
    if (tmp_path / "table.csv").exists():
        assert list(table(tmp_path / "table.csv")["step [-]"]) == list(range(moments[-1]))
    else:
        assert len(after) == len(before) + len(moments) - 1
    for path in tmp_path.glob("*.pvd"):
        assert [len(meshio.read(p).points) for _, p in pvd(path)] == [36] * (2 + len(moments))
    for path in tmp_path.glob("*.xdmf"):
        assert len(xdmf(path)) == 2 + len(moments)


# -- several ranks, particles that leave -------------------------------------

MANY = """
import sys
from pathlib import Path
import logging; logging.disable(logging.INFO)
import tawami
from test_series import block, drive
outputs = [
    tawami.ParticleOutput("number", "velocity", "plastic_strain", every_steps=4),
    tawami.GridOutput("velocity", "reaction", "stress", every_steps=4, projection="consistent"),
    tawami.GridOutput("mean stress", "particles", name="lumped", format="xdmf"),
    tawami.TableOutput("energies", "momentum", "run-out", "displacement (0.0, 1.25)", "particles"),
]
tawami.run(lambda: drive(block(), outputs, Path(sys.argv[1]), 12), "driver")
"""


@pytest.mark.mpi
def test_several_ranks_write_the_same_once(tmp_path):
    for number in (1, 2):
        run = start(number, "-c", MANY, str(tmp_path / str(number)))
        assert run.returncode == 0, run.stderr
    one, two = (tmp_path / "1", tmp_path / "2")
    assert sorted(contents(one)) == sorted(contents(two))
    for index in ("particles.pvd", "grid.pvd"):
        for (_, alone), (_, shared) in zip(pvd(one / index), pvd(two / index), strict=True):
            a, b = meshio.read(alone), meshio.read(shared)
            np.testing.assert_allclose(a.points, b.points, rtol=0, atol=1e-10)
            for name, values in a.point_data.items():
                size = max(np.nanmax(np.abs(values), initial=0.0), 1e-6)
                np.testing.assert_allclose(b.point_data[name], values, rtol=0, atol=1e-7 * size)
    for (_, a), (_, b) in zip(xdmf(one / "lumped.xdmf"), xdmf(two / "lumped.xdmf"), strict=True):
        for name, values in a.items():
            np.testing.assert_allclose(b[name], values, rtol=0, atol=1e-8)
    a, b = table(one / "table.csv"), table(two / "table.csv")
    for name, values in a.items():
        np.testing.assert_allclose(b[name], values, rtol=1e-8, atol=1e-8)
    assert np.ptp(a["energy dissipated [J/m]"]) > 0


def test_particles_that_left_are_not_written(tmp_path):
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0.0, 0.0), h=0.25, cells=(4, 4))
    body = tawami.box(grid, (0.5, 0.25), (1.0, 0.75))
    law = tawami.linear_elastic(E=1e2, nu=0.3)
    options = {"form": "u_finite", "density": 1.0, "leaving": "remove"}
    scene = tawami.Scene(grid, body, law, **options)
    motion = tawami.Dynamics(scene, velocity=(2.0, 0.0))
    output = tawami.ParticleOutput("number", "velocity")
    drive(motion, [output, tawami.TableOutput("particles")], tmp_path, 6, dt=0.02)
    present = table(tmp_path / "table.csv")["particles [-]"]
    assert present[0] == 16
    assert 0 < present[-1] < 16
    for (_, path), number in zip(pvd(tmp_path / "particles.pvd"), present, strict=True):
        mesh = meshio.read(path)
        numbers = mesh.point_data["number [-]"]
        assert len(mesh.points) == number == len(np.unique(numbers))
        assert (np.diff(numbers.astype(int)) > 0).all()
    assert set(numbers) == set(range(16)) - {number for number, _, _ in scene.left}
