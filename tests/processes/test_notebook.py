"""The kernel of a notebook: tables, pictures and bars of progress, without warnings."""

from __future__ import annotations

from pathlib import Path

import pytest

BLOCK = """
import tawami
from mpi4py import MPI
grid = tawami.Grid(MPI.COMM_WORLD, origin=(0.0, 0.0), h=0.5, cells=(6, 3))
body = tawami.box(grid, (0.5, 0.5), (1.5, 1.0))
jelly = tawami.linear_elastic(E=1e4, nu=0.3)
scene = tawami.Scene(grid, body, jelly, form="u_finite", density=1.0)
motion = tawami.Dynamics(scene, velocity=(1.0, 0.0))
"""


@pytest.fixture(scope="module")
def notebook(tmp_path_factory):
    """Runs cells one after the other; each returns its outputs as kind -> text."""
    from jupyter_client.manager import start_new_kernel  # installed by `make test-all`

    manager, client = start_new_kernel(cwd=str(tmp_path_factory.mktemp("notebook")))
    outputs: dict[str, str] = {}

    def listen(message):
        content = message["content"]
        if message["msg_type"] == "stream":
            outputs[content["name"]] = outputs.get(content["name"], "") + content["text"]
        elif message["msg_type"] == "error":
            outputs["error"] = "\n".join(content["traceback"])
        for kind, data in content.get("data", {}).items():
            outputs[kind] = outputs.get(kind, "") + data

    def run(cell):
        outputs.clear()
        client.execute_interactive(cell, output_hook=listen, timeout=120)
        assert "error" not in outputs, outputs["error"]
        return dict(outputs)

    run(BLOCK)
    yield run
    client.stop_channels()
    manager.shutdown_kernel(now=True)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
@pytest.mark.filterwarnings("ignore::ResourceWarning")
def test_a_notebook_shows_tables_pictures_and_progress(notebook):
    assert "<table>" in notebook("scene")["text/html"]
    run = notebook("motion.run(0.5, 0.1, results=tawami.Results('block')); None")
    assert "100%|" in run["stderr"]
    assert "motion 0.5 of 0.5 s" in run["stderr"]
    assert "arning" not in run["stderr"]
    assert "<table>" in notebook("solution = motion.step(0.1); solution")["text/html"]
    assert "image/png" in notebook("solution.plot('velocity x');")
    assert "image/png" in notebook("import matplotlib.pyplot as plt; plt.plot([1, 2]);")
    film = notebook("motion.animate(1.0, 0.1, 'velocity x')")
    assert film["text/html"].count("data:image/png;base64") == 5
    assert "arning" not in film["stderr"]
    assert "velocity x [m/s]" in notebook("solution.to_pandas()")["text/html"]
    assert "stderr" not in notebook("cloud = solution.to_pyvista()")


@pytest.mark.slow
def test_pyvista_reads_the_files_of_a_run(tmp_path):
    import numpy as np
    import pyvista
    from runs import static_scene

    import tawami

    outputs = tawami.ParticleOutput("stress", "displacement"), tawami.GridOutput("mean stress")
    scene = static_scene()
    tawami.ramp(scene, 0.5, results=tawami.Results(tmp_path, *outputs))
    reader = pyvista.get_reader(str(tmp_path / "ramp" / "particles.pvd"))
    assert list(reader.time_values) == [0.0, 0.5, 1.0]
    reader.set_active_time_value(1.0)
    (mesh,) = reader.read()
    np.testing.assert_allclose(mesh["stress xx yy zz xy [Pa]"], scene.particles.stress)
    (file,) = sorted(Path(tmp_path / "ramp").glob("grid/*.vtu"))[-1:]
    assert pyvista.read(file).n_cells == 40
