"""The folder of a run: what happens where it exists, its content, what later scenes read from it."""

from __future__ import annotations

import json

import numpy as np
import pytest
from runs import ELASTIC, Kill, Killed, Recorder, block, results_of, run, steps_in

import tawami

# -- a folder that exists ---------------------------------------------------------


def test_a_run_is_not_written_over_by_default(interrupted):
    (interrupted / "mine.txt").write_text("mine")
    with pytest.raises(tawami.InputError, match="holds a run, last checkpoint '01-motion-0") as no:
        run(interrupted, existing="stop")
    assert "existing='resume'" in str(no.value)
    kill = Kill()
    run(interrupted, existing="replace", each=kill)
    assert kill.count == 10
    assert (interrupted / "mine.txt").read_text() == "mine"


def test_a_run_that_failed_before_its_first_step_can_be_started_again(tmp_path):
    with pytest.raises(tawami.InputError, match="'velocty' is unknown"):
        run(tmp_path / "run", outputs=[tawami.ParticleOutput("velocty")], existing="stop")
    kill = Kill()
    run(
        tmp_path / "run",
        outputs=[tawami.ParticleOutput("velocity")],
        existing="stop",
        each=kill,
    )
    assert kill.count == 10


def test_replacing_a_run_removes_only_its_own_files(interrupted, tmp_path):
    for name in ("motion-analysis", "ramps"):
        (interrupted / name).mkdir()
    (interrupted / "motion-energy.png").write_text("")
    run(interrupted, existing="replace")
    assert (interrupted / "motion-energy.png").exists()
    assert (interrupted / "motion-analysis").is_dir()
    other = tmp_path / "mine"
    other.mkdir()
    (other / "script.py").write_text("mine")
    with pytest.raises(
        tawami.InputError, match="holds 'script.py', which does not belong to a run"
    ):
        run(other, existing="replace")
    assert (other / "script.py").read_text() == "mine"


def test_a_finished_run_without_checkpoints_cannot_be_resumed(tmp_path):
    run(tmp_path / "run", outputs=[tawami.TableOutput("energies")])
    for path in results_of(tmp_path / "run").checkpoints:
        path.unlink()
    with pytest.raises(
        tawami.InputError, match="finished motion, and no checkpoint to resume it from"
    ):
        run(tmp_path / "run")
    assert steps_in(tmp_path / "run" / "motion" / "table.csv") == list(range(11))


def test_the_environment_takes_precedence_over_the_script(interrupted, monkeypatch):
    monkeypatch.setenv("TAWAMI_EXISTING", "resume")
    kill = Kill()
    run(interrupted, existing="stop", each=kill)
    assert kill.count == 4
    monkeypatch.setenv("TAWAMI_EXISTING", "again")
    with pytest.raises(
        tawami.InputError, match="TAWAMI_EXISTING = 'again': expected one of 'stop'"
    ):
        results_of(interrupted)


# -- what is rejected -------------------------------------------------------------


def test_a_folder_that_cannot_be_made_is_named(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(tawami.OutputError, match=r"result folder '.*file/run' cannot be written"):
        run(tmp_path / "file" / "run")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"folder": 3}, "folder = 3"),
        ({"checkpoint_steps": 0}, "checkpoint_steps = 0"),
        ({"checkpoint_minutes": -1.0}, "checkpoint_minutes = -1.0"),
        ({"keep": 0}, "keep = 0"),
        ({"existing": "append"}, "existing = 'append'"),
        ({"outputs": ["stress"]}, "'stress'"),
        (
            {"outputs": [tawami.TableOutput(), tawami.TableOutput("energies")]},
            "2 outputs are called 'table'.*expected another name",
        ),
    ],
)
def test_wrong_results_are_rejected(tmp_path, options, message):
    options = dict(options)
    folder, outputs = options.pop("folder", tmp_path), options.pop("outputs", [])
    with pytest.raises(tawami.InputError, match=message):
        tawami.Results(folder, *outputs, **options)


def test_results_of_another_type_are_rejected():
    motion = tawami.Dynamics(block())
    with pytest.raises(tawami.InputError, match=r"results = 'folder': expected tawami\.Results"):
        motion.run(0.1, 0.01, results="folder")


# -- its content ------------------------------------------------------------------


def test_the_end_of_a_run_is_the_initial_state_of_another_scene(tmp_path):
    motion, _ = run(tmp_path / "run")
    end = motion.scene.particles
    for path in (tmp_path / "run", results_of(tmp_path / "run").checkpoints[-1]):
        state = tawami.earlier(path)
        scene = tawami.Scene(
            motion.scene.grid, state.body, ELASTIC, form="u_epsv_finite", density=1000.0
        )
        scene.initial("stress", state)
        again = tawami.Dynamics(scene, velocity=state)
        for mine, others in (
            (scene.particles.x, end.x),
            (scene.particles.stress, end.stress),
            (again.velocity, motion.velocity),
        ):
            assert np.array_equal(mine, others)
    with pytest.raises(tawami.InputError, match="a folder of results with checkpoints"):
        tawami.earlier(tmp_path)


def test_run_json_lists_the_phases(tmp_path):
    with pytest.raises(Killed):
        run(tmp_path / "run", each=Kill(5))
    run(tmp_path / "run")
    known = json.loads((tmp_path / "run" / "run.json").read_text())
    (motion,) = known["phases"]
    assert (motion["name"], motion["reached"], motion["steps"]) == ("motion", 0.05, 10)
    assert motion["began"] <= motion["finished"]
    assert any(line.startswith("motion ") for line in motion["input"])


def test_an_output_sees_its_phases_only(tmp_path):
    phases = [None, ["motion"], ["ramp"]]
    outputs = [Recorder(f"recorder-{k}", phases=of) for k, of in enumerate(phases)]
    scene = block()
    scene.fix("bottom", "x")
    results = results_of(tmp_path / "run", *outputs)
    tawami.ramp(scene, 0.5, results=results)
    scene.release("bottom", "x")
    tawami.Dynamics(scene).run(0.02, 0.01, results=results)
    began = [[name for name, _ in output.began] for output in outputs]
    assert began == [["ramp", "motion"], ["motion"], ["ramp"]]
    with pytest.raises(
        tawami.InputError, match="phases = 'ramp': expected a list with some of 'ramp'"
    ):
        tawami.ParticleOutput(phases="ramp")
