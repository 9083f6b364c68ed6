"""Series of files that are cut short: by a kill, a full disk, or particles that leave."""

from __future__ import annotations

import json

import meshio
import numpy as np
import pytest
from mpi4py import MPI
from programs import on_ranks, small_files
from readers import contents, pvd, table
from runs import drive, look, plastic_block, write_everything

import tawami


def all_outputs():
    return [
        tawami.ParticleOutput("velocity", "stress", every=0.009),
        tawami.ParticleOutput("velocity", every_steps=3, name="raw"),
        tawami.GridOutput("mean stress", every_steps=4),
        tawami.TableOutput("energies", "step size", "reaction bottom"),
    ]


def test_a_resumed_run_leaves_the_same_files(tmp_path):
    whole, cut = tmp_path / "whole", tmp_path / "cut"
    drive(plastic_block(), all_outputs(), whole, 12)
    motion, outputs, states = plastic_block(), all_outputs(), []

    def checkpoint(motion, solution, step):
        if step == 7:  # the state after step 6
            states.extend(json.loads(json.dumps([output.state() for output in outputs])))

    # runs to step 10 after the checkpoint, and is killed while a file and a row are written
    drive(motion, outputs, cut, 10, seen=checkpoint)
    (cut / "particles" / ".1234-particles-000011.vtu").write_bytes(b"<VTK")
    with (cut / "table.csv").open("a") as file:
        file.write("11,0.04")
    again, resumed = plastic_block(), all_outputs()
    for _ in range(6):
        again.step(0.004)
    drive(again, resumed, cut, 12, first=7, states=states)
    left = contents(cut)
    left.pop("particles/.1234-particles-000011.vtu")
    assert left == contents(whole)


def test_files_later_than_the_checkpoint_are_removed(tmp_path):
    output = tawami.ParticleOutput("velocity")
    motion = plastic_block()
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


def test_a_resumed_table_must_have_the_same_columns(tmp_path):
    output = tawami.TableOutput("run-out")
    motion = plastic_block()
    drive(motion, [output], tmp_path, 2)
    before = (tmp_path / "table.csv").read_text()
    with pytest.raises(
        tawami.InputError, match=r"run-out \[m\], and .*momentum y .* are requested"
    ):
        tawami.TableOutput("momentum").begin(tmp_path, motion, output.state())
    assert (tmp_path / "table.csv").read_text() == before


def test_a_damaged_index_is_named(tmp_path):
    (tmp_path / "particles.pvd").write_text("<VTKFile><Coll")
    motion = plastic_block()
    with pytest.raises(
        tawami.OutputError, match=r"particles.pvd' cannot be read .*remove it to start"
    ):
        tawami.ParticleOutput("velocity").begin(
            tmp_path, motion, {"seen": 3, "written": 3, "time": 0.1}
        )


@pytest.mark.parametrize(
    ("output", "room"),
    [
        (lambda: tawami.ParticleOutput("velocity", "stress"), 3_000),
        (lambda: tawami.ParticleOutput("velocity", "stress"), 1_000),
        (lambda: tawami.TableOutput("energies"), 900),
    ],
)
def test_a_full_disk_raises_an_error_and_leaves_complete_files(output, room, tmp_path):
    motion, writer = plastic_block(), output()
    drive(motion, [writer], tmp_path, 2)
    before = contents(tmp_path)
    moments = []

    def on():
        for step in range(3, 30):
            moments.append(step)
            solution = motion.step(0.004)
            look(writer, motion.scene, motion, solution, motion.time, step, last=False)

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


@pytest.mark.mpi
@pytest.mark.direct  # the ranks have the solver by default
def test_several_ranks_write_the_same_files_once(tmp_path):
    one, two = (tmp_path / "1", tmp_path / "2")
    write_everything(one)
    program = (
        f"import runs, tawami; tawami.run(lambda: runs.write_everything({str(two)!r}), 'driver')"
    )
    run = on_ranks(2, "-c", program)
    assert run.returncode == 0, run.stderr
    assert sorted(contents(one)) == sorted(contents(two))
    for index in ("particles.pvd", "grid.pvd", "lumped.pvd"):
        for (_, alone), (_, shared) in zip(pvd(one / index), pvd(two / index), strict=True):
            a, b = meshio.read(alone), meshio.read(shared)
            np.testing.assert_allclose(a.points, b.points, rtol=0, atol=1e-10)
            for name, values in a.point_data.items():
                size = max(np.nanmax(np.abs(values), initial=0.0), 1e-6)
                np.testing.assert_allclose(b.point_data[name], values, rtol=0, atol=1e-7 * size)
    a, b = table(one / "table.csv"), table(two / "table.csv")
    for name, values in a.items():
        np.testing.assert_allclose(b[name], values, rtol=1e-8, atol=1e-8)
    assert np.ptp(a["energy dissipated [J/m]"]) > 0


def test_particles_that_left_are_not_written(tmp_path):
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0.0, 0.0), h=0.25, cells=(4, 4))
    body = tawami.box(grid, (0.5, 0.25), (1.0, 0.75), per_axis=2)
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
