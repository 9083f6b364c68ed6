"""Steps from within a step, or from each=, are rejected; so are changes within a step."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

import tawami

E = 1e4


def scene_of(law=None, *, form="u", density=1.0):
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=0.25, cells=(4, 6))
    body = tawami.box(grid, (0, 0), (1, 1), per_axis=2)
    law = law or tawami.linear_elastic(E=E, nu=0.3)
    scene = tawami.Scene(grid, body, law, form=form, density=density)
    for component in "xy":
        scene.fix("bottom", component)
    return scene


#: Calls that a function of the script may make, of a scene with a motion.
STEPS = {
    "solve": lambda scene, motion: scene.solve(),
    "step": lambda scene, motion: motion.step(1e-3),
    "run": lambda scene, motion: motion.run(motion.time + 1e-3, 1e-3),
    "ramp": lambda scene, motion: tawami.ramp(scene),
    "settle": lambda scene, motion: tawami.settle(scene),
    "follow": lambda scene, motion: tawami.follow(scene, "arc length", size=1e-3, to=1e-3),
    "Dynamics": lambda scene, motion: tawami.Dynamics(scene),
    "initial": lambda scene, motion: scene.initial("displacement", (0.0, 0.0)),
}
CHANGES = {
    "fix": lambda scene, load: scene.fix("left", "x"),
    "hold": lambda scene, load: scene.hold((1.0, 1.0), "x"),
    "wall": lambda scene, load: scene.wall("top"),
    "release a place": lambda scene, load: scene.release("bottom"),
    "traction": lambda scene, load: scene.traction("left", (1.0, 0.0)),
    "load": lambda scene, load: scene.load([0], (1.0, 0.0)),
    "gravity": lambda scene, load: scene.gravity((1.0, 0.0)),
    "remove": lambda scene, load: scene.remove([0]),
    "change_material": lambda scene, load: scene.change_material([0], scene_law()),
    "change": lambda scene, load: load.change((1.0, 0.0)),
    "release": lambda scene, load: load.release(),
    "residual": lambda scene, load: scene.residual(np.zeros(scene.num_coefficients)),
    "tangent": lambda scene, load: scene.tangent(np.zeros(scene.num_coefficients)),
}


def scene_law():
    return tawami.linear_elastic(E=E, nu=0.0)


class Within:
    """A function of the script that calls another one of the scene, once it is given."""

    def __init__(self):
        self.act = None

    def __call__(self, value):
        if self.act is not None:
            self.act()
        return value


def law_of(within):
    c = E * np.diag([1.0, 1.0, 1.0, 0.5])

    def respond(strain, stress):
        within(None)
        return stress + strain @ c, np.broadcast_to(c, (len(strain), 4, 4))

    return tawami.NumpyLaw(respond, K=E / 3, mu=E / 2)


def loaded(place, within):
    """A scene with a function of the script at a place, its motion, and a load."""
    scene = scene_of(law_of(within) if place == "law" else None)
    load = scene.gravity(
        (0.0, -1.0), amplitude=(lambda t: within(1.0)) if place == "amplitude" else None
    )
    if place == "velocity":
        scene.hold((0.5, 1.0), "x", velocity=lambda t: within(0.0))
    if place == "profile":
        scene.traction("top", (0.0, lambda x, y: within(1.0) + 0 * x))
    return scene, tawami.Dynamics(scene), load


@pytest.mark.parametrize("place", ["law", "amplitude", "velocity", "profile"])
def test_nothing_happens_within_a_step(place):
    """It raises, and the step is then solved as if nothing had happened."""
    within = Within()
    scene, motion, load = loaded(place, within)
    if place == "profile":  # the block does not reach the top; the error is the same
        scene.configuration.loads.all.pop()
        scene.traction("bottom", (0.0, lambda x, y: within(1.0) + 0 * x))
    step = motion.step if place == "velocity" else lambda dt: scene.solve(until=scene.time + dt)
    before = scene.particles.rows().tobytes()
    acts = [lambda act=act: act(scene, motion) for act in STEPS.values()]
    acts += [lambda act=act: act(scene, load) for act in CHANGES.values()]
    for act in acts:
        within.act = act
        with pytest.raises(
            tawami.InputError, match="was called while a step of this scene was being"
        ):
            step(1e-3)
    within.act = None
    assert scene.particles.rows().tobytes() == before
    step(1e-3)
    whole, other, _ = loaded(place, Within())
    if place == "profile":
        whole.configuration.loads.all.pop()
        whole.traction("bottom", (0.0, lambda x, y: 1.0 + 0 * x))
    other.step(1e-3) if place == "velocity" else whole.solve(until=1e-3)
    assert whole.particles.rows().tobytes() == scene.particles.rows().tobytes()


@pytest.mark.parametrize("run", ["ramp", "settle", "follow", "motion"])
def test_a_run_does_not_take_steps_of_another(run, tmp_path):
    """From each=, and from an output where there is no each=."""
    scene = scene_of(form="u_finite")
    weight = scene.gravity((0.0, -1.0))
    motion = tawami.Dynamics(scene)
    for name, step in STEPS.items():

        def act(_, step=step):
            step(scene, motion)

        class Output(tawami.TableOutput):
            def observe(self, snapshot, act=act):
                act(snapshot)

        results = tawami.Results(tmp_path / name, Output("particles")) if run == "settle" else None
        runs = {
            "ramp": lambda act=act: tawami.ramp(scene, 0.5, each=act),
            "settle": lambda results=results: tawami.settle(scene, results=results),
            "follow": lambda act=act: tawami.follow(
                scene, ((0.5, 1.0), "y"), size=1e-4, to=-1e-3, each=act
            ),
            "motion": lambda act=act: motion.run(motion.time + 2e-3, 1e-3, each=act),
        }
        with pytest.raises(
            tawami.InputError, match="was called within a run of this scene, by each"
        ):
            runs[run]()
        weight.change((0.0, scene.configuration.loads.gravity[1] - 1.0))
    scene.solve()  # it is free again
    tawami.Dynamics(scene).step(1e-3)


def test_loads_and_supports_change_in_each():
    scene = scene_of()
    weight, found = scene.gravity((0.0, -1.0)), []
    motion = tawami.Dynamics(scene)

    def turned(_):
        weight.change((0.0, -1.0 - motion.steps))
        scene.residual(np.zeros(scene.num_coefficients))
        found.append(scene.configuration.loads.gravity[1])

    motion.run(0.003, 0.001, each=turned)
    assert found == [-2.0, -3.0, -4.0]
