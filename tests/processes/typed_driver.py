"""A driver with annotations: checked by mypy (tests/processes/test_typing.py), never run.

mypy must report the lines that end in `# wrong: CODE ...`, with one of these codes, and no others.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

import tawami
from tawami.base.files import result_folder
from tawami.form import vector
from tawami.results.single import write_grid, write_particles

Array = npt.NDArray[np.float64]


def respond(strain: Array, stress: Array) -> tuple[Array, Array]:
    """A law."""
    return stress + 1e6 * strain, np.broadcast_to(1e6 * np.eye(4), (len(strain), 4, 4))


def materials() -> list[tawami.Material]:
    """Each law."""
    elastic = tawami.linear_elastic(E=1e6, nu=0.3)
    return [
        elastic,
        tawami.linear_elastic(K=1e6, mu=1e5),
        tawami.linear_elastic(E=1e6, one_minus_2nu=1e-6),
        tawami.von_mises(elastic, yield_stress=1e4, hardening=1e3),
        tawami.drucker_prager(elastic, phi=20, c=10.0, psi=5.0, eps_v_max=0.1),
        tawami.mohr_coulomb(elastic, phi=20, tiny_angle=False),
        tawami.neo_hookean(E=1e6, nu=0.3),
    ]


def statics(comm: MPI.Comm) -> float:
    """A scene, its supports and loads."""
    grid = tawami.Grid(comm, origin=(0, -0.5), h=1 / 16, cells=(32, 16))
    body = tawami.box(grid, (0, -0.5), [2.0, 0.5], per_axis=3, gauss=True)
    tawami.polygon(grid, [(0, 0), (1, 0), (0, 0.4)], per_axis=2)
    mine = tawami.Body(np.zeros((1, 2)), np.ones(1))
    scene = tawami.Scene(
        grid, body, materials()[:2], material_of=np.zeros(4), form="u_epsv", alpha=0.1
    )
    scene.fix("left", "x")
    scene.fix("left", "y", lambda x, y: 1e-3 * y**2)
    scene.hold((2.0, 0.0), "y", 1e-3)
    scene.wall("bottom", friction=0.3, separates=False)
    scene.fix(lambda x, y: (x == 2) & (y > 0), "normal", amplitude=lambda t: 1e-3 * t).release()
    scene.fix(["left", "bottom"], "tangent", velocity=0.1).release()
    pull = scene.traction("right", (0.0, lambda x, y: -1e3 * (1 - 4 * y**2)))
    scene.pressure(scene.border.x[:, 1] > 0.4, lambda x, y: 1e3 * x, amplitude=0.5).change(2e3)
    pull.change((0.0, -1e3), amplitude=lambda t: 2 * t)
    pull.release()
    scene.hold((2.0, 0.5), "y", amplitude=0.5).change(1e-3)
    scene.load(np.flatnonzero(mine.x[:, 0] > 0), (0.0, -1.0))
    scene.load(lambda x, y: y > 0, np.ones((4, 2))).change(np.zeros((4, 2)))
    print((body.named("clay") + mine.named("sand")).names)
    removed = scene.remove("sand")
    print(removed.mass, removed.momentum[0], removed.number.size)
    scene.change_material("clay", materials()[0])
    scene.release("left", "y")
    scene.gravity((0, -9.81))
    print(scene.header(), scene.num_particles, scene.particles.stress.mean())
    solution: tawami.Solution = scene.solve()
    stress: Array = solution.mean_stress
    reaction: Array = solution.reaction("left") + solution.reaction((2.0, 0.0))
    folder = result_folder(Path("results") / "beam")
    write_particles(folder / "particles.vtu", solution)
    write_grid("grid.vtu", solution)
    return float(stress.max() + reaction[0] + solution.displacement((2, 0))[1])


def dynamics(comm: MPI.Comm) -> None:
    """Ramp, settle, motion and results."""
    grid = tawami.Grid(comm, origin=(0.0, 0.0), h=0.1, cells=[10, 10])
    block = tawami.box(grid, (0, 0), (0.5, 0.5), per_axis=2)
    law = tawami.NumpyLaw(respond, K=1e6, mu=1e6)
    small = tawami.Scene(grid, block, law, form="u", density=[1000.0], leaving="remove")
    small.fix("left", "x", velocity=lambda time: 0.1 * np.sin(time))
    scene = tawami.Scene(grid, block, materials()[0], form=Path("my_form.py"), density=1000)
    numbers: list[int] = []
    steps = tawami.ramp(scene, 0.1, each=lambda solution: numbers.append(solution.iterations))
    tawami.settle(scene, tolerance=1e-9, max_resets=10)
    motion = tawami.Dynamics(scene, velocity=(0.0, -1.0), transfer="apic", gamma=0.6)
    motion.run(end=1.0, dt=1e-3, smallest=1e-6)
    results = tawami.Results(
        Path("results") / "block",
        tawami.ParticleOutput("stress", tawami.Quantity("size [m]", lambda p: p.x), every=0.1),
        tawami.GridOutput("mean stress", every_steps=10, projection="consistent"),
        tawami.TableOutput("energies", phases=["motion"]),
        checkpoint_steps=100,
        existing="resume",
    )
    motion.run(end=2.0, dt=1e-3, results=results)
    tawami.ramp(scene, 0.1, results="results")  # wrong: arg-type
    tawami.Results("results", "stress")  # wrong: arg-type
    tawami.Results("results", existing="append")  # wrong: arg-type
    tawami.ParticleOutput("stress", every="often")  # wrong: arg-type
    ring: tawami.Body = tawami.disc(grid, (0.5, 0.5), 0.4, inner=0.1, gauss=True, per_axis=2)
    tawami.level_set(grid, lambda x, y: np.hypot(x, y) - 0.4, ends=["left", "bottom"], per_axis=2)
    tawami.level_set(grid, lambda x, y: x, ends=["north"], per_axis=2)  # wrong: list-item
    layers = tawami.mesh(grid, "pile.msh", tags="gmsh:physical", per_axis=2)
    whole = tawami.Scene(grid, layers, {"clay": materials()[0]}, density={"clay": 1800.0})
    whole.initial("stress", lambda x, y: (0 * x, y, 0 * x, 0 * x))
    whole.initial("stress", tawami.earlier("results/block"), beyond="return")
    whole.initial("stress", tawami.table("k0.csv"), beyond="ignore")  # wrong: arg-type
    tawami.Dynamics(whole, velocity=lambda x, y: (0 * x, y)).run(ring.volume.sum(), 1e-3)
    energy: float = motion.energies.kinetic + motion.kinetic_energy
    print(energy, motion.angular_momentum(), motion.time, steps[-1].size, len(scene.left))


def contact(scene: tawami.Scene) -> float:
    """Rigid obstacles."""
    plane = scene.obstacle(tawami.half_plane((0, 0), (0, 1)), 0.3, "bottom", name="floor")
    block = tawami.rigid_polygon([(0, 1), (1, 1), (1, 2)], radius=0.1)
    footing = scene.obstacle(block, force=(0.0, -1e3), free=("x", "y"), mass=10.0)
    moved = scene.obstacle(tawami.rigid_disc((0, 3), 1.0), velocity=(0.1, lambda t: -t, 0.0))
    scene.obstacle(
        lambda x, y: np.hypot(x, y) - 1, displacement=(0.0, 0.1), amplitude=0.5
    ).release()
    plane.change(friction=0.5)
    moved.change(velocity=(0.0, 0.0))
    footing.change((0.0, -2e3), amplitude=lambda t: t)
    result = scene.solve().contact(footing)
    pressure: Array = result.pressure
    print(scene.solve().contact("floor").moment, footing.rotation, scene.border.names)
    return float(pressure.max() + result.force[1] + footing.x[0] + result.penetration)


def bordered(grid: tawami.Grid, cloud: tawami.Body) -> tawami.Scene:
    """A body of loose particles with a border, and its files."""
    border: tawami.Border = tawami.polyline([(0, 0), (1, 0), (1, 1)], names=["a", "b", "c"])
    body = tawami.Body(cloud.x, cloud.volume, border=border)
    scene = tawami.Scene(grid, body, materials()[0], volumes="fitted")
    tawami.Results("results", tawami.BorderOutput(every=0.1), tawami.TableOutput("reaction a"))
    return scene


def weak_form() -> bool:
    """A form of the script, and its check."""

    def residual(w: Any, sigma: Any, sum_p: Any) -> Any:
        return sum_p(sigma, w.grad)

    form = tawami.Form({"u": vector("w")}, residual=residual)
    report: tawami.FormReport = tawami.check_form(form)
    return report.usable and tawami.check_form("u_epsv", alpha=0.1).usable


def run(n: int, alpha: float) -> dict[str, float]:
    """The function of a study."""
    return {"error": n * alpha}


def study() -> str:
    """Settings run one by one."""
    beside = tawami.Series("FEM", run, {"n": [4, 8]})
    study = tawami.Study(
        "beam", run, {"n": (4, 8), "alpha": (0.01, 0.1)}, {"error": 0.0}, beside=[beside]
    )
    table = study.run()
    return tawami.study.verdict(table) + str(tawami.recommend(study, 0.01).knobs["n"])


def wrong(comm: MPI.Comm) -> None:
    """Mistakes that a type checker finds before anything runs."""
    grid = tawami.Grid(comm, origin=(0, 0), h="1/16", cells=(2, 2))  # wrong: arg-type
    tawami.Grid(comm, origin=(0, 0), h=1.0, cells=(2.5, 2))  # wrong: arg-type
    body = tawami.box(grid, (0, 0), (1, 1), per_axis=2.0)  # wrong: arg-type
    tawami.linear_elastic(1e6, 0.3)  # wrong: misc call-arg
    tawami.linear_elastic(E=1e6, poisson=0.3)  # wrong: call-arg
    law = tawami.linear_elastic(E="soft", nu=0.3)  # wrong: arg-type
    tawami.von_mises(1e6, yield_stress=1.0)  # wrong: arg-type
    tawami.Scene(body, grid, law)  # wrong: arg-type
    tawami.Scene(grid, body, "steel")  # wrong: arg-type
    tawami.Scene(grid, body, law, basis="cubic")  # wrong: arg-type
    tawami.Scene(grid, body, law, leaving="ignore")  # wrong: arg-type
    tawami.Scene(grid, body, law, form=3)  # wrong: arg-type
    scene = tawami.Scene(grid, body, law)
    scene.wall("west")  # wrong: arg-type
    scene.fix("left", 1)  # wrong: arg-type
    scene.fix("left", "x", "held")  # wrong: arg-type
    scene.fix("left", "x", lambda y: y)  # wrong: arg-type misc
    scene.hold("left", "x")  # wrong: arg-type
    scene.traction("right", 1e3)  # wrong: arg-type
    scene.traction("right", (0.0, "down"))  # wrong: arg-type
    scene.gravity(-9.81)  # wrong: arg-type
    scene.pressure("top", "high")  # wrong: arg-type
    scene.obstacle("plane")  # wrong: arg-type
    scene.obstacle(tawami.rigid_disc((0, 1), 1.0), force=1e3)  # wrong: arg-type
    tawami.Scene(grid, body, law, volumes="exact")  # wrong: arg-type
    tawami.BorderOutput(every="often")  # wrong: arg-type
    print(scene.solve().strains)  # wrong: attr-defined
    print(scene.solve().plot(3))  # wrong: arg-type
    tawami.Dynamics(scene, transfer="musl")  # wrong: arg-type
    tawami.Dynamics(scene).run(1.0)  # wrong: call-arg
    tawami.NumpyLaw(lambda strain: strain, K=1.0, mu=1.0)  # wrong: arg-type misc
    tawami.settle(scene, most=3)  # wrong: call-arg
    tawami.ramp(scene, each=3)  # wrong: arg-type
    tawami.Study("beam", run, knobs=[4, 8])  # wrong: list-item
    number: str = scene.num_particles  # wrong: assignment
    print(number, tawami.no_such_name)  # wrong: attr-defined
