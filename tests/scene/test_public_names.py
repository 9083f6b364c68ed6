"""Public attributes of the objects of a driver script, and attributes that cannot be set."""

from __future__ import annotations

import pytest
from scenes import grid_of

import tawami

#: Attributes that raise an error naming the object or the switch that has them.
ABSENT = {"velocity", "acceleration", "energies", "plastic_strain", "deformation_gradient"}
#: Attributes for observers and checkpoints; `configuration` leads to the rest of the package.
OF_A_RUN = {"scene", "motion", "state", "restore", "identity", "header"}
SCENE = {
    "grid", "form", "basis", "parameters", "options", "numerics", "particles", "num_particles",
    "laws", "mass", "particles_per_cell", "left", "stopwatch", "configuration",
    "initial", "data", "parameter", "flux", "fix", "hold", "wall", "obstacle", "release",
    "traction", "load", "pressure", "border", "gravity", "remove", "change_material",
    "time", "solve", "solve_part", "advanced",
    "residual", "tangent", "reduction", "split", "num_coefficients",
}  # fmt: skip
DYNAMICS = {
    "transfer", "damping", "gamma", "beta", "time", "steps", "step", "run", "animate",
    "velocity", "acceleration", "velocity_gradient", "mass", "on_grid",
    "energies", "kinetic_energy", "elastic_energy", "linear_momentum", "angular_momentum",
}  # fmt: skip
SOLUTION = {
    "scene", "u", "volumetric", "unknowns", "load", "iterations", "history", "krylov", "condition",
    "symmetric", "arrays", "number", "x", "volume", "stress", "strain", "mean_stress",
    "displacement_of_particles", "own", "num_particles",
    "eps_v", "field", "coefficients", "displacement", "reaction", "contact", "on_edges", "on_points",
    "plot", "to_pandas", "to_pyvista", "error", "owned",
}  # fmt: skip


@pytest.fixture(scope="module")
def scene():
    grid = grid_of()
    body = tawami.box(grid, grid.origin, grid.upper, per_axis=2)
    scene = tawami.Scene(grid, body, tawami.linear_elastic(E=1.0, nu=0.3), density=1.0)
    scene.fix("bottom", "x")
    scene.fix("bottom", "y")
    return scene


def names_of(thing: object) -> set[str]:
    return {name for name in dir(thing) if not name.startswith("_")}


def test_public_names(scene):
    motion = tawami.Dynamics(scene)
    assert names_of(scene) == SCENE | OF_A_RUN | ABSENT
    assert names_of(motion) == DYNAMICS | OF_A_RUN
    assert names_of(motion.step(1e-3)) == SOLUTION | ABSENT


def test_every_object_says_what_it_is(scene):
    motion = tawami.Dynamics(scene)
    assert repr(scene.grid) == "Grid(4 x 3 cells of 0.5 m, [-1, 1] x [0.5, 2] m)"
    body = tawami.Body(scene.particles.x, scene.particles.volume, names=("clay",))
    assert repr(body) == "Body(48 particles, 3 m2, materials clay)"
    assert repr(scene) == (
        "Scene(48 particles on 4 x 3 cells of 0.5 m, form 'u_epsv', linear_elastic)"
    )
    assert repr(motion) == (
        f"Dynamics({scene!r}, affine_flip, gamma 0.5, at {scene.time:g} s after 0 steps)"
    )
    assert repr(motion.step(1e-3)).startswith("Solution('u_epsv': 48 particles, 68 unknowns, ")


def test_handles_say_what_they_are():
    grid = grid_of()
    body = tawami.box(grid, grid.origin, grid.upper, per_axis=2)
    scene = tawami.Scene(grid, body, tawami.linear_elastic(E=1.0, nu=0.3), density=1.0)
    weight = scene.gravity((0, -10))
    assert repr(weight) == "Weight(gravity (0, -10) m/s2)"
    weight.release()
    assert repr(weight) == "Weight(gravity (0, -10) m/s2, released)"
    assert repr(scene.fix("left", "x", 0.1)) == "Support(fix('left'))"
    assert repr(scene.wall("top", 0.3)) == "Wall(wall(edge='top') friction 0.3)"
    assert repr(scene.traction("right", (1.0, 0.0))) == "Traction(traction('right'))"
    assert repr(scene.load([1, 2], (1.0, 0.0))) == "Forces(force on 2 particles)"


@pytest.mark.parametrize(
    ("name", "way"),
    [
        ("alpha", r"Scene.alpha cannot be set: expected scene.parameter\('alpha'"),
        ("stabilisation", r"Scene\(..., stabilisation=...\)"),
        ("particles", r"scene.particles.stress\[:\] = ..."),
        ("parameters", "Scene.parameters cannot be set"),
        ("tolerence", r"Scene.tolerence cannot be set: a scene is given by Scene\(...\)"),
    ],
)
def test_attributes_of_a_scene_cannot_be_set(scene, name, way):
    with pytest.raises(tawami.InputError, match=way):
        setattr(scene, name, 1.0)


@pytest.mark.parametrize("name", ["alpha", "beta"])
def test_parameters_of_the_form_cannot_be_set(scene, name):
    with pytest.raises(
        tawami.InputError,
        match=rf"'{name}' cannot be set to 1.0: expected scene.parameter\(name, value\)",
    ):
        scene.parameters[name] = 1.0
    assert dict(scene.parameters) == {"alpha": 0.01, "k": 0.003, "k_v": 0.03}


def test_attributes_of_motions_and_solutions_cannot_be_set(scene):
    motion = tawami.Dynamics(scene)
    with pytest.raises(tawami.InputError, match=r"as motion.velocity\[:\] = ..."):
        motion.velocity = (1.0, 0.0)
    with pytest.raises(tawami.InputError, match=r"Dynamics.time cannot be set"):
        motion.time = 0.0
    with pytest.raises(tawami.InputError, match=r"Solution.stress cannot be set"):
        motion.step(1e-3).stress = 0.0
