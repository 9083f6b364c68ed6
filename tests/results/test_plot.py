"""Pictures of a run, from its files alone."""

from __future__ import annotations

import json

import numpy as np
import pytest
from mpi4py import MPI
from PIL import Image
from programs import python
from runs import look

import tawami
from tawami.picture import film
from tawami.picture.particles import Corners, scale_of
from tawami.picture.style import scaled
from tawami.results import film as pictures
from tawami.results import provenance
from tawami.results.frame import Frame
from tawami.results.plot import plot

WRITTEN = ("stress", "mean stress", "displacement")


@pytest.fixture(scope="module")
def scene():
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0.0, 0.0), h=0.25, cells=(12, 4))
    body = tawami.box(grid, (0.0, 0.0), (1.0, 1.0), per_axis=2)
    return tawami.Scene(grid, body, tawami.linear_elastic(E=1e3, nu=0.3), form="u_finite")


def run_of(folder, scene, *, phases=("ramp", "motion"), frames=5, names=WRITTEN):
    """Write a block that moves to the right under a growing stress, without solving anything."""
    x = np.array(scene.particles.x)
    output = tawami.ParticleOutput(*names)
    table = tawami.TableOutput("run-out", "particles", "Newton iterations")
    provenance.write(folder, scene)
    for phase in phases:
        for writer in (output, table):
            writer.begin(folder / phase, scene, None)
        for step in range(frames):
            scene.particles.move_to(x + np.array([0.2 * step, 0.0]))
            scene.particles.stress[:, :2] = [-1e4 * step, -2e4 * step]
            scene.particles.stress[:, 3] = 3e4 * x[:, 1]
            for writer in (output, table):
                look(writer, scene, None, None, 0.25 * step, step, last=step == frames - 1)
    scene.particles.move_to(x)


def test_a_run_is_drawn_from_its_files(scene, tmp_path):
    run_of(tmp_path, scene, phases=("ramp",))
    run_of(tmp_path, scene, phases=("motion",))
    written = plot(tmp_path)
    expected = [f"{phase}-{what}" for phase in ("ramp", "motion")
                for what in ("mean-stress.png", "mean-stress.gif")]  # fmt: skip
    expected += ["ramp-table.png", "motion-table.png"]
    assert written == [tmp_path / "figures" / name for name in expected]
    for name in expected:
        with Image.open(tmp_path / "figures" / name) as image:
            assert min(image.size) > 200
            assert getattr(image, "n_frames", 1) == (5 if name.endswith("gif") else 1)


def test_the_title_is_inside_the_picture():
    x = np.array([[0.1, 0.1], [0.7, 0.2]])
    frame = film.Frame("$t$ = 0.3 s", x, 0.1, np.array([0.0, 1.0]))
    scale = scale_of("mean stress", "Pa", [frame.values], None)
    grid = Corners(np.zeros(2), np.array([0.8, 0.3]))
    made = film.Film([frame], scale, grid)
    made.figure.canvas.draw()
    assert made.axes.title.get_window_extent().y1 < made.figure.bbox.y1


def test_a_movie_has_one_scale_of_colours_and_one_view(scene, tmp_path):
    run_of(tmp_path, scene, phases=("motion",))
    movie = next(path for path in plot(tmp_path) if path.suffix == ".gif")
    with Image.open(movie) as image:
        frames = []
        for k in range(image.n_frames):
            image.seek(k)
            frames.append(np.asarray(image.convert("RGB"), dtype=int))
    height = frames[0].shape[0]
    body, bar = slice(0, int(0.7 * height)), slice(int(0.8 * height), height)
    for frame in frames[1:]:  # the colour bar and its numbers
        assert np.abs(frame[bar] - frames[0][bar]).max() < 12
    middles = [np.mean(np.nonzero(np.ptp(f[body], axis=2) > 40)[1]) for f in frames]
    steps = np.diff(middles)
    assert (steps > 0).all()
    np.testing.assert_allclose(steps, steps.mean(), rtol=0.05)


def test_components_and_norms_can_be_drawn(scene, tmp_path):
    run_of(tmp_path, scene, phases=("motion",), frames=2)
    drawn = plot(tmp_path, quantity="stress xx", movie=None)
    assert [path.name for path in drawn] == ["motion-stress-xx.png", "motion-table.png"]
    frame = Frame(
        np.zeros((2, 3)), "vertex", np.arange(2)[:, None],
        {"velocity [m/s]": np.array([[3.0, -4.0, 0.0], [0.0, 1.0, 0.0]]),
         "stress xx yy zz xy [Pa]": np.arange(8.0).reshape(2, 4), "eps_v [-]": np.ones(2)},
    )  # fmt: skip
    found = pictures.scalars(frame)
    expected = {
        "velocity": ("m/s", [5, 1]), "velocity x": ("m/s", [3, 0]), "velocity y": ("m/s", [-4, 1]),
        "stress xx": ("Pa", [0, 4]), "stress yy": ("Pa", [1, 5]), "stress zz": ("Pa", [2, 6]),
        "stress xy": ("Pa", [3, 7]), "eps_v": ("-", [1, 1]), "mean stress": ("Pa", [1, 5]),
        "deviatoric stress q": ("Pa", [np.sqrt(30), np.sqrt(150)]),
    }  # fmt: skip
    assert {name: unit for name, (unit, _) in found.items()} == {
        k: v[0] for k, v in expected.items()
    }
    for name, (_, values) in expected.items():
        assert found[name][1] == pytest.approx(values)
    with pytest.raises(
        tawami.InputError,
        match=r"quantity = 'strss': the run did not write it: expected one of 'stress xx', .*mean str",
    ):
        plot(tmp_path, quantity="strss")


@pytest.mark.parametrize(("name", "drawn"), [("stress", "mean-stress"), ("number", "number")])
def test_a_run_is_drawn_whatever_it_wrote(scene, tmp_path, name, drawn):
    run_of(tmp_path, scene, phases=("motion",), frames=2, names=[name])
    (tmp_path / "motion" / "table.csv").unlink()
    assert [path.name for path in plot(tmp_path, movie=None)] == [f"motion-{drawn}.png"]


def test_a_run_without_particles_has_its_tables_drawn(scene, tmp_path):
    run_of(tmp_path, scene, phases=("motion",), frames=2)
    (tmp_path / "motion" / "particles.pvd").unlink()
    assert [path.name for path in plot(tmp_path)] == ["motion-table.png"]
    with pytest.raises(tawami.InputError, match="no particles with a quantity to draw: expected a"):
        plot(tmp_path, quantity="stress xx")


def test_large_stresses_are_shown_in_kpa_or_mpa():
    assert scaled("Pa", 2.5e4) == ("kPa", 1e3)
    assert scaled("Pa", 2.5e6) == ("MPa", 1e6)
    assert scaled("Pa", 20.0) == ("Pa", 1.0)
    assert scaled("m/s", 2e4) == ("m/s", 1.0)


def test_a_folder_that_cannot_be_drawn_is_rejected(scene, tmp_path):
    with pytest.raises(tawami.InputError, match="run.json. cannot be read .*: expected the folder"):
        plot(tmp_path)
    provenance.write(tmp_path, scene)
    with pytest.raises(
        tawami.InputError, match="no particles with a quantity to draw: expected a run with tawami"
    ):
        plot(tmp_path)
    with pytest.raises(tawami.InputError, match="movie = 'avi': expected 'gif' or 'mp4'"):
        plot(tmp_path, movie="avi")
    run_of(tmp_path, scene, phases=("motion",), frames=2)
    (tmp_path / "motion" / "particles" / "particles-000001.vtu").write_text("no VTU")
    with pytest.raises(tawami.OutputError, match=r"particles-000001.vtu' cannot be read"):
        plot(tmp_path)
    index, table = tmp_path / "motion" / "particles.pvd", tmp_path / "motion" / "table.csv"
    text = index.read_text()
    for old, new, message in [
        ('timestep="0.25"', 'timestep=""', "particles.pvd' .*its entry 2 has the time ''"),
        ('timestep="0.25"', "", r"its entry 2 has the time ''"),
        ('timestep="0.25"', 'timestep="nan"', r"its entry 2 has the time 'nan'"),
        ('file="particles/particles-000001.vtu"', "", "its entry 2 has the file '', which is not in"),
        ("particles/particles-000001.vtu", "/dev/zero", "'/dev/zero', which is not in this folder"),
        ("particles/particles-000001.vtu", "../../a.vtu", "'../../a.vtu', which is not in this folder"),
    ]:  # fmt: skip
        assert old in text
        index.write_text(text.replace(old, new))
        with pytest.raises(tawami.OutputError, match=message):
            plot(tmp_path)
    index.unlink()
    run_of(tmp_path, scene, phases=("motion",), frames=2)
    text = table.read_text()
    for new, message in [
        (text.replace("\n1,", "\n1,1,"), "table.csv' .*line 3 has 6 cells, and the header 5"),
        (text.replace("\n1,0.25", "\n1,0;25"), "line 3, column '.*time .*': '0;25': expected"),
        (text.replace("[", "(").replace("]", ")"), "its column 'run-out .m.' has no unit in brackets"),
        ("", "it is empty"),
    ]:  # fmt: skip
        table.write_text(new)
        with pytest.raises(tawami.OutputError, match=message):
            plot(tmp_path, movie=None)
    (tmp_path / "run.json").write_text(json.dumps({"grid": None}))
    with pytest.raises(tawami.OutputError, match=r"run.json' cannot be read"):
        plot(tmp_path)


def test_a_missing_package_or_program_is_named(scene, tmp_path, monkeypatch):
    run_of(tmp_path, scene, phases=("motion",), frames=2)
    code = "import sys; sys.modules['matplotlib'] = None\nfrom tawami.results.plot import plot\n"
    code += f"plot({str(tmp_path)!r})"
    run = python("-c", code)
    assert "MissingDependencyError: pictures need matplotlib: pip install" in run.stderr
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(
        tawami.MissingDependencyError, match="'mp4' needs ffmpeg: install it, or use"
    ):
        plot(tmp_path, movie="mp4")


def test_nothing_outside_the_folder_is_read(scene, tmp_path):
    """Links to a table, an index, a file of a series, a phase and the record of the run."""
    home, other = tmp_path / "run", tmp_path / "other"
    for folder in (home, other):
        run_of(folder, scene, phases=("motion",), frames=2)
    for name in ("motion/table.csv", "motion/particles.pvd", "motion", "run.json"):
        kept = home / "kept"
        (home / name).rename(kept)
        (home / name).symlink_to(other / name)
        with pytest.raises(tawami.InputError, match=rf"is a link to '{other}/{name}.*outside the"):
            plot(home, movie=None)
        (home / name).unlink()
        kept.rename(home / name)
    last = home / "motion" / "particles" / "particles-000001.vtu"
    last.unlink()
    last.symlink_to(other / "motion" / "particles" / "particles-000001.vtu")
    with pytest.raises(tawami.OutputError, match="its entry 2 has the file .*not in this folder"):
        plot(home, movie=None)
