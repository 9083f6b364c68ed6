"""Interrupted runs resume where they were, to the bit, and leave no gap in their outputs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI
from numpy_laws import von_mises
from runs import ELASTIC, Kill, Killed, Recorder, block, results_of, run, steps_in

import tawami

LAWS = {
    "elastic": ELASTIC,
    "von Mises": tawami.von_mises(ELASTIC, yield_stress=4e3, hardening=1e4),
    "in NumPy": von_mises(ELASTIC.bulk_modulus, ELASTIC.shear_modulus, 4e3, 1e4),
    "Mohr-Coulomb": tawami.mohr_coulomb(ELASTIC, phi=30.0, c=1e3),
}


def fall(results, *, form, law, transfer, solver, each):
    """Load a block in a ramp, then let it slide on a rough floor; everything that the run computes.

    Two ramps and two motions, with supports that are added and released between them.
    """
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(-1, -1), h=0.125, cells=(16, 10))
    body = tawami.box(grid, (-0.25, -1.0), (0.25, -0.5), per_axis=2)
    options = {"density": 1000.0, "alpha": 0.01, "linear_solver": solver}
    scene = tawami.Scene(grid, body, LAWS[law], form=form, **options)
    finite = form.endswith("finite")
    scene.fix("bottom", "y")
    scene.fix("bottom", "x")
    scene.gravity((0.0, -9.81))
    steps = [tawami.ramp(scene, 0.3, results=results, each=each)]
    scene.load(scene.particles.x[:, 1] > -0.6, (0.0, -20.0))  # where they are after the ramp
    if finite:
        scene.hold((0.0, -0.75), "x", 1e-3)
        steps.append(tawami.ramp(scene, 0.5, results=results, each=each))
        scene.release((0.0, -0.75))
    scene.release("bottom")
    if finite:
        scene.wall("bottom", 0.3)
    else:
        scene.fix("bottom", "y")
        scene.hold((0.0, -0.75), "x", velocity=lambda t: 0.02 * t)
    motion = tawami.Dynamics(scene, velocity=(0.3, 0.0), transfer=transfer, gamma=0.6)
    scene.particles.displacement[:, 0] += 1e-7  # a change between two phases
    steps.append(motion.run(0.05, 0.004, results=results, each=each))
    steps.append(motion.run(0.08, 0.005, results=results, each=each))
    return {
        "rows": scene.particles.rows(),
        "energies": str(motion.energies),
        "time": (motion.time, motion.steps),
        "steps": steps,
        "left": scene.left,
    }


@pytest.mark.parametrize(
    ("form", "law", "transfer", "solver", "kills"),
    [
        ("u_epsv", "elastic", "affine_flip", "auto", (2, 9, 17)),
        ("u_epsv_finite", "elastic", "affine_flip", "multigrid", (3, 6, 12)),
        ("u_epsv_finite", "Mohr-Coulomb", "apic", "auto", (11, 20)),
        ("u_epsv_finite", "in NumPy", "flip", "auto", (1, 2, 21)),
    ],
)
def test_a_killed_run_resumes_to_the_bit(tmp_path, form, law, transfer, solver, kills):
    options = {"form": form, "law": law, "transfer": transfer, "solver": solver}
    recorders = {name: Recorder() for name in ("whole", "killed")}
    whole = fall(
        results_of(tmp_path / "whole", recorders["whole"], existing="stop"), each=None, **options
    )
    kill, attempts = Kill(*kills), 0
    while True:
        attempts += 1
        try:
            found = fall(results_of(tmp_path / "killed", recorders["killed"]), each=kill, **options)
            break
        except Killed:
            continue
    assert attempts == len(kills) + 1
    assert found.pop("rows").tobytes() == whole.pop("rows").tobytes()
    assert found == whole
    reused = any(step.krylov[0] > 0 for step in whole["steps"][-1])
    assert reused == (
        form == "u_epsv" or solver == "multigrid"
    )  # the factorisation of an earlier step
    assert recorders["killed"].seen == recorders["whole"].seen
    # resumed again: nothing is solved, the end is loaded
    again = fall(results_of(tmp_path / "killed"), each=Kill(1), **options)
    assert again.pop("rows").tobytes() != b""
    assert again == found


def test_a_finished_run_can_be_extended(tmp_path):
    run(tmp_path / "run")
    kill = Kill()
    motion, steps = run(tmp_path / "run", end=0.07, each=kill)
    assert kill.count == 4  # of 14 steps
    assert len(steps) == 14
    whole, _ = run(tmp_path / "whole", end=0.07)
    assert motion.scene.particles.x == pytest.approx(np.array(whole.scene.particles.x), abs=1e-12)


def test_an_extended_run_that_is_killed_resumes_from_its_newest_state(tmp_path):
    run(tmp_path / "run", end=0.02)
    with pytest.raises(Killed):
        run(tmp_path / "run", end=0.05, each=Kill(5))  # in the ninth step of all
    kill = Kill()
    run(tmp_path / "run", end=0.05, each=kill)
    assert kill.count == 2
    assert np.array_equal(
        tawami.earlier(tmp_path / "run").x, run(tmp_path / "run")[0].scene.particles.x
    )


def test_an_error_before_the_first_step_changes_no_checkpoint(interrupted):
    before = {path: path.read_bytes() for path in interrupted.rglob("*.npz")}
    with pytest.raises(tawami.InputError, match="'pressure' is unknown"):
        run(interrupted, outputs=[tawami.ParticleOutput("pressure")])
    assert {path: path.read_bytes() for path in interrupted.rglob("*.npz")} == before
    kill = Kill()
    run(interrupted, each=kill)
    assert kill.count == 4


def test_outputs_may_change_where_a_run_resumes(tmp_path):
    """Outputs find their own state by their names; a new one begins at the resumed step."""
    first = [tawami.TableOutput("energies"), tawami.ParticleOutput("velocity")]
    with pytest.raises(Killed):
        run(tmp_path / "run", outputs=first, each=Kill(6))
    then = [tawami.ParticleOutput("velocity"), tawami.TableOutput("energies"),
            tawami.TableOutput("run-out", name="front")]  # fmt: skip
    run(tmp_path / "run", outputs=then)
    folder = tmp_path / "run" / "motion"
    assert steps_in(folder / "table.csv") == list(range(11))
    assert steps_in(folder / "front.csv") == list(range(5, 11))
    assert len(list((folder / "particles").glob("*.vtu"))) == 11


def test_an_error_of_the_driver_leaves_no_gap_in_a_table(tmp_path):
    table = tawami.TableOutput("energies")
    for number in (3, 10):
        kill = Kill(number, error=tawami.InputError("no"))
        with pytest.raises(tawami.InputError):
            run(tmp_path / str(number), outputs=[table], each=kill)
        run(tmp_path / str(number), outputs=[tawami.TableOutput("energies")])
        folder = tmp_path / str(number) / "motion"
        assert steps_in(folder / "table.csv") == list(range(11))


def test_an_error_of_an_output_leaves_no_gap_in_a_table(tmp_path):
    class Failing(Recorder):
        def observe(self, moment):
            if moment.step == 5:
                raise tawami.OutputError("full")
            super().observe(moment)

    with pytest.raises(tawami.OutputError):
        run(tmp_path / "run", outputs=[tawami.TableOutput("energies"), Failing()])
    run(tmp_path / "run", outputs=[tawami.TableOutput("energies"), Recorder()])
    assert steps_in(tmp_path / "run" / "motion" / "table.csv") == list(range(11))


def test_gravity_that_changes_during_a_run_is_part_of_its_state(tmp_path):
    def driven(folder, each):
        scene = block()
        (weight,) = scene.configuration.loads.all
        motion = tawami.Dynamics(scene, velocity=(1.0, 0.0))

        def turned(solution):
            if motion.steps == 3:
                weight.change((0.0, 5.0))
            if each is not None:
                each(solution)

        motion.run(0.05, 0.005, results=results_of(folder), each=turned)
        return scene.particles.rows()

    with pytest.raises(Killed):
        driven(tmp_path / "run", Kill(6))
    whole = driven(tmp_path / "whole", None)
    assert driven(tmp_path / "run", None).tobytes() == whole.tobytes()


def test_loads_that_are_added_during_a_run_cannot_be_resumed(tmp_path):
    def driven(each):
        scene = block()
        motion = tawami.Dynamics(scene)

        def loaded(solution):
            if motion.steps == 3:
                scene.load([0], (0.0, -1.0))
            each(solution)

        motion.run(0.05, 0.005, results=results_of(tmp_path / "run"), each=loaded)

    with pytest.raises(Killed):
        driven(Kill(6))
    with pytest.raises(
        tawami.CheckpointError, match="2 loads when it was stored, and the script made 1"
    ):
        driven(Kill())


@pytest.mark.parametrize("solver", ["auto", "multigrid"])
def test_a_phase_after_a_failed_one_resumes(tmp_path, monkeypatch, solver):
    """The driver expects a limit load: the ramp fails, and the motion that begins there is killed."""
    monkeypatch.setitem(tawami.Scene.__init__.__kwdefaults__, "linear_solver", solver)

    def driven(each):
        scene = block()
        scene.fix("bottom", "x")
        scene.load([0], (0.0, -4e4))
        results = results_of(tmp_path / "run")
        with pytest.warns(tawami.IncompleteWarning):
            assert not tawami.ramp(scene, 0.1, smallest=0.03, results=results).complete
        motion = tawami.Dynamics(scene)
        motion.run(0.005, 0.0005, results=results, each=each)

    with pytest.raises(Killed):
        driven(Kill(8))
    kill = Kill()
    driven(kill)
    assert kill.count == 4


def test_a_ramp_resumes_after_an_error(tmp_path):
    def loaded(each, size):
        scene = block()
        scene.fix("bottom", "x")
        steps = tawami.ramp(scene, size, results=results_of(tmp_path / "run"), each=each)
        return scene, steps

    with pytest.raises(tawami.InputError):
        loaded(Kill(3, error=tawami.InputError("no")), 0.125)
    scene, steps = loaded(None, 0.125)
    assert [step.end for step in steps] == [0.125 * k for k in range(1, 9)]
    weight = scene.solve().reaction("bottom")[1]
    assert weight == pytest.approx(0.25 * 1000 * 9.81, rel=1e-4)


def test_settling_resumes_where_it_gave_up(tmp_path):
    def held():
        scene = block()
        scene.fix("bottom", "x")
        return scene

    def settled(most):
        return tawami.settle(held(), max_resets=most, results=results_of(tmp_path / "run"))

    with pytest.raises(tawami.ConvergenceError):
        settled(2)
    assert len(settled(50)) == len(tawami.settle(held(), max_resets=50))


def test_a_resumed_run_may_have_shorter_steps(interrupted):
    motion = tawami.Dynamics(block(), velocity=(1.0, 0.0))
    steps = motion.run(0.05, 0.0025, results=results_of(interrupted))
    assert [step.size for step in steps[6:]] == pytest.approx([0.0025] * 8)


def test_a_resumed_run_may_have_more_iterations(interrupted):
    scene = block()
    scene.configuration.numerics = replace(scene.numerics, max_iterations=30, factorise="always")
    kill = Kill()
    run(interrupted, scene=scene, each=kill)
    assert kill.count == 4


def cycled(results, each, form="u_epsv_finite"):
    """Loads and supports that follow amplitudes, change, fade and are released, in three phases."""
    scene = block()
    (weight,) = scene.configuration.loads.all
    plate = scene.hold((0.75, 0.5), "y", -0.01, amplitude=lambda t: t)
    push = scene.load([3, 5], (40.0, 0.0), amplitude=lambda t: np.cos(3 * t))
    side = scene.hold((0.5, 0.25), "x")
    steps = [tawami.ramp(scene, 0.3, until=1.0, results=results, each=each)]
    weight.change((0.0, -5.0))
    push.release()
    plate.change(-0.02)
    steps.append(tawami.ramp(scene, 0.3, until=2.0, results=results, each=each))
    plate.release()
    side.release()
    wall = scene.wall("right")
    wall.change(0.2)
    scene.load([7], (0.0, 3.0), amplitude=lambda t: np.sin(50 * t))
    motion = tawami.Dynamics(scene, velocity=(0.3, 0.0), gamma=0.6)
    steps.append(motion.run(2.03, 0.004, results=results, each=each))
    state = (
        scene.configuration.loads.state(scene.configuration.domain.layout)["all"],
        scene.configuration.supports.state()["supports"],
    )
    state = repr(state)
    return scene.particles.rows().tobytes(), str(motion.energies), scene.time, steps, state


def test_a_killed_run_with_changed_and_released_loads_resumes_to_the_bit(tmp_path):
    whole = cycled(results_of(tmp_path / "whole"), None)
    kill, attempts = Kill(2, 5, 8, 12), 0
    while True:
        attempts += 1
        try:
            found = cycled(results_of(tmp_path / "killed"), kill)
            break
        except Killed:
            continue
    assert attempts == 5
    assert found == whole
    again = cycled(results_of(tmp_path / "killed"), Kill(1))  # nothing is solved
    assert again == whole


@pytest.mark.parametrize(
    ("change", "resumes"),
    [
        (lambda load, side: load.change((0.0, -4.0), amplitude=0.5), True),
        (lambda load, side: side.change(velocity=0.1), False),
        (lambda load, side: load.change(amplitude=lambda t: 0.5), False),
    ],
)
def test_changes_to_numbers_during_a_run_are_part_of_its_state(tmp_path, change, resumes):
    def driven(folder, each):
        scene = block()
        (weight,) = scene.configuration.loads.all
        side = scene.hold((0.75, 0.25), "x", velocity=0.2)
        motion = tawami.Dynamics(scene)

        def changing(solution):
            if motion.steps == 3:
                change(weight, side)
            if each is not None:
                each(solution)

        motion.run(0.05, 0.005, results=results_of(folder), each=changing)
        return scene.particles.rows()

    with pytest.raises(Killed):
        driven(tmp_path / "run", Kill(6))
    if not resumes:
        with pytest.raises(
            tawami.CheckpointError, match="was changed to a function or another velocity"
        ):
            driven(tmp_path / "run", None)
        return
    whole = driven(tmp_path / "whole", None)
    assert driven(tmp_path / "run", None).tobytes() == whole.tobytes()
