"""Scenes that test_ranks.py solves on several ranks; the first rank writes the results to a file.

python tests/processes/on_ranks.py FILE
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import heated
import numpy as np
from mpi4py import MPI
from numpy_laws import von_mises
from scenes import BASES, FORMS, grid_of

import tawami
from cases.showcase.collapse.pile import build as pile_of_rods
from cases.verification.cantilever import fem, mpm
from tawami import _rust
from tawami.base.ranks import allgathered
from tawami.form import vector
from tawami.form.form import Form
from tawami.results import write_grid, write_particles
from tawami.solve.newton import Newton

COMM = MPI.COMM_WORLD


def beams() -> dict[str, float | np.ndarray]:
    """The cantilever by every form and support, and by every form and assembly."""
    found: dict[str, float | np.ndarray] = {}
    for support in ("paper", "exact", "clamped"):
        for method, alpha in (("u", None), ("u_bbar", None), ("u_epsv", 0.1), ("u_p", 0.1)):
            paths = ("points", "dolfinx") if support == "paper" else ("points",)
            for path in paths:
                row, solution = mpm.solve(method, support, 4, alpha, assembly=path)
                name = f"beam {support} {method} {path}"
                found[f"{name} deflection"] = row.deflection_m
                found[f"{name} mean stress"] = solution.mean_stress
                if row.mean_stress_l2 is not None:
                    found[f"{name} error"] = row.mean_stress_l2
    for method in fem.METHODS:
        row = fem.solve(method, "exact", 4)
        found[f"{method} deflection"], found[f"{method} error"] = (
            row.deflection_m,
            row.mean_stress_l2,
        )
        found[f"{method} unknowns"] = row.unknowns
    return found


def random_clouds() -> dict[str, np.ndarray]:
    """Residual and tangent of random particles in one corner; some ranks have no particle."""
    found = {}
    for name, options in FORMS.items():
        for basis in BASES:
            for path in ("points", "dolfinx") if basis == BASES[0] else ("points",):
                grid, random = grid_of((6, 5)), np.random.default_rng(0)
                x = grid.origin + grid.h * np.array([3.0, 2.5]) * random.random((40, 2))
                body = tawami.Body(x, random.uniform(0.01, 0.1, len(x)))
                materials = [
                    tawami.linear_elastic(E=2.0, nu=0.3),
                    tawami.linear_elastic(E=7.0, nu=0.4),
                ]
                scene = tawami.Scene(grid, body, materials, basis=basis, assembly=path,
                                     material_of=random.integers(0, 2, len(x)), **options)  # fmt: skip
                c = random.standard_normal(scene.num_coefficients)
                found[f"cloud {name} {basis} {path} residual"] = scene.residual(c)
                found[f"cloud {name} {basis} {path} tangent"] = scene.tangent(c).toarray()
    return found


def fields() -> dict[str, np.ndarray]:
    """A form of three fields: residual, tangent, and a solution; some ranks have no particle."""
    found = {}
    for path, theta in (
        ("points", "quadratic_spline"),
        ("points", "bilinear"),
        ("dolfinx", "bilinear"),
    ):
        grid, random = grid_of((6, 5)), np.random.default_rng(0)
        body = tawami.box(grid, grid.origin, (0.5, 2.0))
        law = tawami.linear_elastic(E=2.0, nu=0.3)
        form = heated.form_of(basis=theta)
        scene = tawami.Scene(grid, body, law, form=form, assembly=path, tolerance=1e-11)
        c = random.standard_normal(scene.num_coefficients)
        found[f"fields {theta} {path} residual"] = scene.residual(c)
        found[f"fields {theta} {path} tangent"] = scene.tangent(c).toarray()
        scene.fix("bottom", "x")
        scene.fix("bottom", "y")
        solution = scene.solve()
        found[f"fields {theta} {path} u"] = solution.u
        found[f"fields {theta} {path} all"] = solution.coefficients
        found[f"fields {theta} {path} measure"] = np.array(solution.history[0][2])
    return found


def nonlinear() -> dict[str, np.ndarray]:
    """Several iterations with one factorisation, points held in cells of other ranks, a second step."""
    from ufl import div, grad

    def stiff(u, w, sigma, mu, sum_p):
        return sum_p(sigma, grad(w)) + sum_p(3e3 * mu, div(u) ** 3 * div(w))

    form = Form({"u": vector("w")}, stiff)
    found = {}
    for path in ("points", "dolfinx"):
        grid = grid_of()
        body = tawami.box(grid, grid.origin, grid.upper, per_axis=3)
        material = tawami.linear_elastic(E=1e3, nu=0.2)
        scene = tawami.Scene(grid, body, material, form=form, tolerance=1e-12, assembly=path)
        scene.fix("left", "x")
        scene.fix("left", "y")
        scene.hold((0.2, 1.3), "x", 0.02)
        scene.hold((-0.1, 0.6), "y")
        scene.traction("right", (120.0, lambda x, y: 20.0 * y))
        first = scene.solve()
        found[f"nonlinear {path} first"] = first.u
        scene.traction("top", (0.0, 10.0))
        second = scene.solve()
        found[f"nonlinear {path} second"] = second.u
        found[f"nonlinear {path} stress"] = second.stress
        found[f"nonlinear {path} krylov"] = np.array(first.krylov + second.krylov)
    return found


def border() -> dict[str, np.ndarray]:
    """Sums over a border that crosses the cells of several ranks: a foundation and a pressure."""
    from ufl import cofac, dot

    def residual(u, w, sigma, K, grad, I, old, n, dot_n, sum_p, sum_b, k):  # noqa: E741
        R = sum_p(sigma, grad(w)) + sum_b(k * K * dot(old.u + u, w), on=["0", "2"])
        return R + sum_b(0.1 * dot(dot_n(cofac(I + grad(u))), w)) - sum_b(w[0], on="1")

    data = {"k": "stiffness of the foundation over K [1/m]"}
    grid, random = grid_of((6, 5)), np.random.default_rng(0)
    corners = [(-0.9, 0.6), (1.63, 0.7), (1.5, 2.8), (-0.8, 2.4)]
    body = tawami.polygon(grid, corners, per_axis=3)
    form = Form({"u": vector("w")}, residual, data=data)
    law = tawami.linear_elastic(E=2.0, nu=0.3)
    scene = tawami.Scene(grid, body, law, form=form, tolerance=1e-11)
    scene.data("k", lambda x, y: 1 + y)
    c = random.standard_normal(scene.num_coefficients)
    found = {"border residual": scene.residual(c), "border tangent": scene.tangent(c).toarray()}
    found["border first"], found["border second"] = scene.solve().u, scene.solve().u
    return found


def singular() -> dict[str, np.ndarray]:
    """The error of a singular tangent names cells."""
    grid = grid_of((6, 5))
    body = tawami.box(grid, grid.origin, grid.upper, per_axis=2)
    material = tawami.linear_elastic(E=1.0, nu=0.3)
    scene = tawami.Scene(grid, body, material, basis="biquadratic")
    scene.fix("left", "x")
    scene.hold(grid.origin, "y")
    scene.traction("right", (0.0, -1.0))
    try:
        scene.solve()
    except tawami.SingularError as error:
        named = "is singular" in str(error) and "with 4 particles" in str(error)
        return {"singular": np.array(named)}
    raise AssertionError("a singular tangent was solved")


def motion() -> dict[str, np.ndarray]:
    """A pile that collapses, a block that slides to another rank, one that loses particles."""
    found = {}
    pile = pile_of_rods("u_epsv_finite", h=0.02)
    pile.run(0.006, 1e-3)
    found["motion pile momentum"] = pile.linear_momentum
    found["motion pile energy"] = np.array(pile.energies.dissipated)
    found |= {f"motion pile {k}": v for k, v in whole(pile).items()}
    grid = tawami.Grid(COMM, origin=(0, 0), h=0.25, cells=(8, 4))
    body = tawami.box(grid, (1.0, 0), (1.5, 0.5), per_axis=2)
    law = tawami.linear_elastic(E=1e5, nu=0.4)
    for leaving, speed in (("stop", 5.0), ("remove", 9.0)):
        scene = tawami.Scene(grid, body, law, form="u_epsv_finite", density=1e3, leaving=leaving)
        scene.gravity((0, -10))
        scene.wall("bottom", 0.2)
        scene.load(body.x[:, 1] > 0.3, (10.0, -5.0))
        block = tawami.Dynamics(scene, velocity=np.column_stack([speed + 0 * body.x[:, 0],
                                                                 0 * body.x[:, 0]]))  # fmt: skip
        block.run(0.08, 1e-2)
        found |= {f"motion {leaving} {k}": v for k, v in whole(block).items()}
        found[f"motion {leaving} left"] = np.array([len(scene.left)])
    return found


def construction() -> dict[str, np.ndarray]:
    """A slope of two bodies that is excavated, strengthened, and set in motion."""
    grid = tawami.Grid(COMM, origin=(0, 0), h=0.25, cells=(8, 6))
    lower = tawami.polygon(grid, [(0, 0), (2, 0), (2, 0.6), (0, 0.85)], per_axis=2)
    upper = tawami.polygon(grid, [(0, 0.85), (2, 0.6), (2, 1.25), (0, 1.25)], per_axis=2)
    body = lower.named("clay") + upper.named("fill")
    law = tawami.linear_elastic(E=1e6, nu=0.3)
    laws = {"clay": tawami.von_mises(law, yield_stress=1e4), "fill": law}
    found = {}
    for form in ("u_epsv", "u_epsv_finite"):
        scene = tawami.Scene(grid, body, laws, form=form, density=2e3, tolerance=1e-9)
        for edge, component in (("left", "x"), ("right", "x"), ("bottom", "y")):
            scene.fix(edge, component)
        scene.gravity((0, -10))
        forces = np.outer(body.volume, [50.0, -20.0])
        scene.load("fill", forces[body.material_of == 1])
        scene.solve()
        removed = scene.remove(lambda x, y: (y > 0.9) & (x > 1.0))
        weaker = von_mises(law.bulk_modulus, law.shear_modulus, 5e3, tangent=False)
        scene.change_material(lambda x, y: x < 0.6, weaker)
        tawami.ramp(scene, 0.5)
        block = tawami.Dynamics(scene, velocity=(0.0, 0.01))
        block.step(1e-3)
        scene.remove(lambda x, y: (y > 0.9) & (x > 0.5))
        block.step(1e-3)
        found |= {f"construction {form} {k}": v for k, v in whole(block).items()}
        facts = [
            removed.volume,
            removed.mass,
            removed.elastic,
            block.energies.left,
            len(scene.left),
        ]
        found[f"construction {form} facts"] = np.array(facts)
    return found


def initial() -> dict[str, np.ndarray]:
    """A ring with an initial stress, beyond the yield surface in part; some ranks have no particle."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=0.125, cells=(16, 16))
    ring = tawami.disc(grid, (0.6, 0.7), 0.5, inner=0.2, per_axis=2)
    elastic = tawami.linear_elastic(E=1e6, nu=0.3)
    steel = tawami.von_mises(elastic, yield_stress=1e3)
    stress = np.column_stack([4e3 * (ring.x[:, 0] - 0.6), *(3 * [0 * ring.x[:, 0]])])
    plastic = tawami.Scene(grid, ring, steel)
    told = "no error"
    try:
        plastic.initial("stress", stress)
    except tawami.InputError as error:
        told = str(error)
    assert "beyond the yield surface" in told
    plastic.initial("stress", stress, beyond="return")
    order = np.argsort(allgathered(grid.comm, plastic.particles.number))
    found = {"initial stress": allgathered(grid.comm, np.array(plastic.particles.stress))[order]}
    scene = tawami.Scene(grid, ring, elastic, density=10.0)
    scene.initial("stress", lambda x, y: (4e3 * (x - 0.6), 0.0, 0.0, 0.0))
    for point in ((0.6, 0.3), (0.2, 0.7)):
        scene.hold(point, "x")
        scene.hold(point, "y")
    scene.gravity((0, -1))
    solution = scene.solve()
    return found | {"initial solved": solution.stress, "initial eps_v": solution.eps_v}


def shapes() -> dict[str, np.ndarray]:
    """Particles and numbers of shapes of which each rank makes its part."""
    grid = tawami.Grid(COMM, origin=(0, 0), h=0.125, cells=(16, 8))
    box = tawami.box(grid, (0.01, 0), (1.9, 0.97))
    hill = tawami.level_set(
        grid, lambda x, y: y - 0.6 - 0.1 * np.sin(5 * x), ends=("left", "right", "bottom")
    )
    few = tawami.Body(np.array([[1.3, 0.4], [1.7, 0.6]]), np.array([1e-3, 2e-3]))
    left = tawami.box(grid, (0, 0), (1, 1), per_axis=2)
    bodies = {
        "box": box, "hill": hill, "chosen": box[box.x[:, 0] > box.x[:, 1]], "mixed": left + few,
        "joined": left.named("a") + tawami.polygon(grid, [(1, 0), (2, 0), (1.3, 1)]).named("b"),
    }  # fmt: skip
    found = {}
    for name, body in bodies.items():
        number = allgathered(COMM, body.number)
        rows = allgathered(COMM, np.column_stack([body.x, body.volume]))[np.argsort(number)]
        assert np.array_equal(np.sort(number), np.arange(len(number)))
        found[f"shapes {name}"] = rows
    return found


def whole(motion: tawami.Dynamics) -> dict[str, np.ndarray]:
    """Arrays of the particles in the order of their numbers."""
    particles, comm = motion.scene.particles, motion.scene.grid.comm
    order = np.argsort(allgathered(comm, particles.number))
    arrays = {"x": particles.x, "stress": particles.stress, "velocity": motion.velocity}
    arrays["strain"] = particles.strain
    return {name: allgathered(comm, np.array(values))[order] for name, values in arrays.items()}


def beam(**options: Any) -> tawami.Scene:
    """A clamped beam of 128 particles, of a law that may be given."""
    grid = tawami.Grid(COMM, origin=(0, 0), h=0.25, cells=(8, 4))
    law = options.pop("law", tawami.linear_elastic(E=1.0, nu=0.3))
    scene = tawami.Scene(grid, tawami.box(grid, (0, 0), (2, 1), per_axis=2), law, **options)
    scene.fix("left", "x")
    scene.fix("left", "y")
    return scene


class BrokenError(Exception):
    """An error that cannot be pickled."""

    def __init__(self, one: str, two: str) -> None:
        super().__init__(f"{one} {two}")


def errors() -> dict[str, np.ndarray]:
    """Errors that one rank raises and all catch, and that the ranks compute together afterwards."""

    def respond(strain, stress):
        if COMM.rank == COMM.size - 1:
            raise BrokenError("of the law,", "on one rank")
        return stress, np.broadcast_to(np.eye(4), (len(strain), 4, 4))

    found = {}
    try:
        beam(law=tawami.NumpyLaw(respond, K=1.0, mu=1.0)).solve()
    except (BrokenError, RuntimeError) as error:  # the first on one rank
        found["errors law"] = np.array(COMM.allgather(str(error)))
    scene = beam()
    scene.traction("right", (0.0, 1e-3))
    found["errors iterations"] = np.array(COMM.allgather(scene.solve().iterations))
    scene.particles.stress[np.flatnonzero(scene.particles.number == 101)] = np.nan
    try:
        scene.solve()
    except tawami.InputError as error:
        found["errors nan"] = np.array(COMM.allgather(str(error)))
    return found


def inverted() -> dict[str, np.ndarray]:
    """A step whose first iterate turns a particle inside out: on some rank, and it is tried again."""
    grid = tawami.Grid(COMM, origin=(0, 0), h=0.25, cells=(6, 4))
    body = tawami.box(grid, (0, 0), (1, 1), per_axis=3, gauss=True)
    law = tawami.von_mises(tawami.linear_elastic(E=1e6, nu=0.3), yield_stress=2e3)
    scene = tawami.Scene(grid, body, law, form="u_epsv_finite")
    scene.fix("left", "x")
    scene.fix("bottom", "y")
    scene.fix("top", "y", -0.05)
    evaluate, seen = Newton.internal, list[int]()

    def internal(self, coefficients):
        try:
            return evaluate(self, coefficients)
        except _rust.InvertedError:
            seen.append(1)
            raise

    Newton.internal, last = internal, list[tawami.Solution]()
    try:
        tawami.ramp(scene, 0.5, each=last.append)
    finally:
        Newton.internal = evaluate
    times = sum(COMM.allgather(len(seen)))
    return {
        "times inverted": np.array(times),
        "inverted floor": np.array(last[-1].reaction("bottom")[1]),
    }


def contact() -> dict[str, np.ndarray]:
    """A disc that is pressed into a bed over several ranks and dragged along it."""
    grid = tawami.Grid(COMM, origin=(0, 0), h=0.25, cells=(9, 6))
    bed = tawami.box(grid, (0, 0), (2, 1.03), per_axis=2)
    law = tawami.linear_elastic(E=1e6, nu=0.3)
    scene = tawami.Scene(grid, bed, law, form="u_epsv_finite", ghost_penalty="on", tolerance=1e-11)
    for side, component in (("bottom", "x"), ("bottom", "y"), ("left", "x")):
        scene.fix(side, component)
    shape = tawami.rigid_disc((0.8, 1.63), 0.6)
    disc = scene.obstacle(shape, 0.3, "top", displacement=(0.01, -0.06))
    tawami.ramp(scene, 0.5)
    solution = scene.solve()
    now = solution.contact(disc)
    return {"contact force": now.force, "contact u": solution.u, "contact pressure": now.pressure}


def stretched() -> dict[str, np.ndarray]:
    """A block that is pulled over several ranks under a dead load, with a border that is divided."""
    grid = tawami.Grid(COMM, origin=(0, 0), h=0.25, cells=(10, 5))
    block = tawami.box(grid, (0, 0), (1, 1.03), per_axis=4)
    rubber = tawami.neo_hookean(E=1e3, nu=0.3)
    scene = tawami.Scene(grid, block, rubber, form="u_finite", ghost_penalty="on", tolerance=1e-11)
    scene.fix("left", "x")
    scene.fix("bottom", "y")
    scene.fix("right", "x", 1.0)
    scene.traction("top", (0.0, -10.0))
    before = len(scene.border.x)
    tawami.ramp(scene, 0.25)
    count = [before, len(scene.border.x)]
    return {"stretched points": np.array(count), "stretched border": scene.border.x}


def sliding() -> dict[str, np.ndarray]:
    """A block that a support off the lines of the grid pushes along a plane, under a pressure, until
    cells change their rank.
    """
    grid = tawami.Grid(COMM, origin=(0, 0), h=0.25, cells=(12, 6))
    block = tawami.box(grid, (0.3, 0.3), (1.3, 1.05), per_axis=2)
    law = tawami.linear_elastic(E=1e6, nu=0.3)
    scene = tawami.Scene(grid, block, law, form="u_epsv_finite", density=1e3,
                         tolerance=1e-11, ghost_penalty="on")  # fmt: skip
    scene.fix("left", "x", velocity=8.0)
    scene.pressure("top", 2e3)
    plane = scene.obstacle(tawami.half_plane((0, 0.3), (0, 1)), 0.2)
    motion = tawami.Dynamics(scene, velocity=(8.0, 0.0))
    divisions = set()
    for _ in range(8):
        last = motion.step(0.01)
        divisions.add(scene.configuration.model.grid.division.cuts.tobytes())
    energies = motion.energies
    return {
        "sliding x": last.x, "sliding border": scene.border.x, "sliding reaction": last.reaction("left"),
        "sliding force": last.contact(plane).force,
        "sliding energies": np.array([energies.kinetic, energies.external, energies.friction]),
        "times divided": np.array(len(divisions)),
    }  # fmt: skip


def wide() -> dict[str, np.ndarray]:
    """A body over ranks that know a part of the grid each: multigrid, ghost penalty, supports and an
    obstacle off its lines, and then a motion along walls.
    """
    grid = tawami.Grid(COMM, origin=(0, 0), h=0.25, cells=(27, 6))
    corners = [(0.1, 0.07), (5.8, 0.1), (5.9, 1.3), (3.0, 1.45), (0.05, 1.2)]
    body = tawami.polygon(grid, corners, per_axis=2)
    law = tawami.linear_elastic(E=1e6, nu=0.4)
    of = {"ghost_penalty": "on", "linear_solver": "multigrid", "tolerance": 1e-11}
    scene = tawami.Scene(grid, body, law, **of)
    scene.fix("4", "x")
    scene.fix("4", "y")
    scene.hold((3.0, 0.7), "x", 1e-3)
    scene.pressure("2", 1e3)
    scene.obstacle(tawami.rigid_disc((1.5, 1.825), 0.5), 0.0, "3", displacement=(0, -0.02))
    solution = scene.solve()
    box = tawami.box(grid, (0, 0), (5, 0.5), per_axis=2)
    scene = tawami.Scene(grid, box, law, form="u_finite", density=1e3, tolerance=1e-9)
    scene.wall("bottom", 0.2)
    scene.wall("left")
    scene.gravity((0, -9.81))
    scene.hold((2.0, 0.3), "x", velocity=0.2)
    motion = tawami.Dynamics(scene)
    for _ in range(2):
        last = motion.step(0.004)
    grid = tawami.Grid(COMM, origin=(0, 0), h=0.25, cells=(6, 27), geometry="axisymmetric")
    post = tawami.box(grid, (0, 0), (1.4, 5.05), per_axis=2)
    scene = tawami.Scene(grid, post, law, ghost_penalty="on", tolerance=1e-11)
    scene.fix("bottom", "y")
    scene.pressure("top", 1e3)
    found = {"wide post": scene.solve().u}
    return found | {
        "wide u": solution.u, "wide force": solution.reaction("4"), "wide x": last.x,
        "wide wall": last.reaction("bottom"), "krylov wide": np.array(solution.krylov),
    }  # fmt: skip


def few_cells() -> dict[str, np.ndarray]:
    """Two cells, of which some ranks have none; a load that is a function of the whole edge."""
    grid = tawami.Grid(COMM, origin=(0, 0), h=1.0, cells=(2, 1))
    law = tawami.linear_elastic(E=1.0, nu=0.3)
    scene = tawami.Scene(grid, tawami.box(grid, (0, 0), (2, 1), per_axis=2), law)
    scene.fix("left", "x")
    scene.fix("left", "y")
    for _ in range(2):
        scene.traction("right", (0.0, lambda x, y: 1e-3 * y / y.max()))
        solution = scene.solve()
    tip = solution.displacement((2, 0))[1]
    return {"few tip": np.array(COMM.allgather(tip)), "few krylov": np.array(solution.krylov)}


def output(folder: Path) -> dict[str, np.ndarray]:
    """Files of the whole body, and the header on every rank."""
    scene = beam(density=1.0)
    header = scene.header()
    scene.traction("right", (0.0, 1e-3))
    solution = scene.solve()
    write_particles(folder / "particles.vtu", solution)
    write_grid(folder / "grid.vtu", solution)
    counts = [scene.particles_per_cell.sum(), scene.num_particles, len(solution.stress)]
    print("solved and written")
    return {"output counts": np.array(counts), "output header": np.array(COMM.allgather(header))}


def results(folder: Path) -> dict[str, Any]:
    """Results of all scenes; files are written to the folder."""
    found = beams() | random_clouds() | fields() | nonlinear() | singular() | motion() | initial()
    found |= construction() | border() | contact() | stretched() | sliding() | wide() | shapes()
    return found | errors() | inverted() | few_cells() | output(folder)


def main() -> None:
    """Write the results of all scenes beside the files of the last one."""
    file = Path(sys.argv[1])
    found = results(file.parent)
    if COMM.rank == 0:
        np.savez(file, **found)


if __name__ == "__main__":
    tawami.run(main, "on_ranks")
