"""Measurement of one setting, in a separate process: prints its numbers as JSON."""

from __future__ import annotations

import json
import logging
import sys
import warnings
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from time import perf_counter, process_time
from typing import Any

import numpy as np
from mpi4py import MPI
from ufl import div, dot, grad, inner

import tawami
from cases.costs.bench.setting import SOLVER, STAGES, Setting
from cases.verification.cantilever import mpm
from cases.verification.cantilever.beam import NU, D, E, L, P
from tawami.fem.environment import peak_memory
from tawami.form import scalar, vector


def stiffening(u, eps_v, w, q, sigma, K, mu, h, sum_p, alpha):  # type: ignore[no-untyped-def]
    """The form of the paper with the additional stress 2 mu grad(u)^T grad(u): Newton iterates."""
    R_u = sum_p(sigma, grad(w))
    R_u += sum_p(2 * mu, inner(dot(grad(u).T, grad(u)), grad(w)))
    R_q = sum_p(K, q * (div(u) - eps_v))
    return R_u + R_q - sum_p(K**2 / mu, alpha * h**2 * dot(grad(q), grad(eps_v)))


STIFFENING = tawami.Form(
    fields={"u": vector("w"), "eps_v": scalar("q", role="volumetric_strain")},
    residual=stiffening,
    parameters={"alpha": {"default": 0.1}},
)
LOADS = 3  # load of the nonlinear beam, over that of the paper
#: Numbers that the stage `law` writes for each particle: stress and its tangent.
ANSWERS = 17


def measure(setting: Setting) -> dict[str, Any]:
    """Measure one step of the paper's beam and one of a nonlinear beam.

    Returns:
        Seconds, processor time, memory, by name.
    """
    warnings.simplefilter("ignore", tawami.InexactSumWarning)  # of the additional stress, earlier
    forms = first_scene(setting)
    mpm.build("u_epsv", "paper", 2, alpha=0.1, assembly=setting.assembly).solve()  # loads libraries
    return {"forms_s": forms} | linear(setting) | nonlinear(setting)


def first_scene(setting: Setting) -> float:
    """Seconds of the first scene of a process, most of it for the form and its kernels."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0.0, 0.0), h=1.0, cells=(4, 2))
    body = tawami.box(grid, grid.origin, grid.upper, per_axis=2)
    law = tawami.linear_elastic(E=E, nu=NU)
    start = perf_counter()
    tawami.Scene(grid, body, law, form="u_epsv", assembly=setting.assembly)
    return perf_counter() - start


def options_of(setting: Setting) -> dict[str, Any]:
    """Options of the beam."""
    return {"alpha": 0.1, "per_axis": setting.per_axis, "assembly": setting.assembly}


def linear(setting: Setting) -> dict[str, Any]:
    """Measure one step of the paper's beam."""
    comm = MPI.COMM_WORLD
    start, busy = perf_counter(), process_time()
    scene = mpm.build("u_epsv", "paper", setting.n, **options_of(setting))
    built = perf_counter() - start
    solution = scene.solve()
    wall, cpu = perf_counter() - start, process_time() - busy
    watch = scene.stopwatch
    outside = sum(watch.cpu.get(stage, 0.0) for stage in STAGES if stage not in SOLVER)
    return {
        "particles": scene.num_particles,
        "unknowns": solution.unknowns,
        "deflection_m": -float(solution.displacement((L, 0.0))[1]),
        "built_s": built,
        "solve_s": wall,
        **{stage: watch.seconds.get(stage, 0.0) for stage in STAGES},
        "set-up": watch.seconds["set-up"],
        "commit": watch.seconds["commit"],
        "step_s": sum(watch.seconds.get(stage, 0.0) for stage in STAGES),
        "cpu_outside_s": comm.allreduce(outside),
        "cpu_s": comm.allreduce(cpu),
        "peak_MB": comm.allreduce(peak_memory()),
        "copy_GB_s": copy_bandwidth(setting.threads),
        "law_GB_s": law_bytes(scene) * len(solution.history) / watch.seconds["law"] / 1e9,
        "active_set_s": change_of_active_cells(scene, setting),
    }


def nonlinear(setting: Setting) -> dict[str, Any]:
    """Measure one step of the nonlinear beam, which reuses its factorisation."""
    mpm.build(STIFFENING, "paper", 2, alpha=0.1, assembly=setting.assembly).solve()  # compiles
    scene = mpm.build(STIFFENING, "paper", setting.n, **options_of(setting))
    scene.traction("right", (0.0, -(LOADS - 1) * P / D))
    busy = process_time()
    solution = scene.solve()
    cpu = MPI.COMM_WORLD.allreduce(process_time() - busy)
    iterations = [
        sum(now.get(stage, 0.0) - before.get(stage, 0.0) for stage in STAGES)
        for before, now in pairwise(scene.stopwatch.laps)
    ]
    later = list(zip(iterations[1:], solution.krylov[1:], strict=True))
    return {
        "iterations": solution.iterations,
        "krylov": list(solution.krylov),
        "first_s": iterations[0],
        "later_s": float(np.mean([s for s, k in later if 0 < k <= 3] or [np.nan])),
        "cpu_nonlinear_s": cpu,
    }


def change_of_active_cells(scene: tawami.Scene, setting: Setting) -> float:
    """Seconds of numbering, supports and pattern for a body in other cells of the same grid."""
    body = tawami.box(scene.grid, (0.0, -D / 2), (0.75 * L, D / 2), per_axis=setting.per_axis)
    material = tawami.linear_elastic(E=E, nu=NU)
    other = tawami.Scene(scene.grid, body, material, alpha=0.1, assembly=setting.assembly)
    other.fix("left", "x")
    other.hold((0.0, 0.0), "y")
    other.hold((0.75 * L, 0.0), "y", -1e-3)
    other.solve()
    return sum(other.stopwatch.seconds.get(stage, 0.0) for stage in ("set-up", "pattern"))


def law_bytes(scene: tawami.Scene) -> int:
    """Bytes that the stage `law` reads and writes at least, for the particles of this rank."""
    particles = scene.particles
    read = particles.stress.nbytes + particles.material.nbytes + len(particles) * (4 + 2 * 8)
    return int(read + 8 * ANSWERS * len(particles))


def copy_bandwidth(threads: int) -> float:
    """Speed of a copy from memory to memory [GB/s], reading and writing counted."""
    size = 1 << 23
    pairs = [(np.ones(size), np.zeros(size)) for _ in range(threads)]
    best = np.inf
    with ThreadPoolExecutor(threads) as pool:
        for _ in range(5):
            start = perf_counter()
            list(pool.map(lambda pair: np.copyto(pair[1], pair[0]), pairs))
            best = min(best, perf_counter() - start)
    return float(threads * 2 * 8 * size / best / 1e9)


def empty_cells(n: int, assembly: str) -> None:
    """Print the cost of cells without particles: the beam in grids larger than the beam."""
    print(f"\nassembly {assembly}: the clamped beam in a grid with empty cells")
    filled, full = 2 * n**2, 0.0
    for factor in (1, 2, 4):
        cells = (2 * n * factor, n * factor)
        seconds = min(_in_a_larger_grid(n, factor, assembly) for _ in range(5))
        full = full or seconds
        empty = cells[0] * cells[1] - filled
        line = f"  {cells[0]:4d} x {cells[1]:4d} cells, {empty:6d} of them empty:"
        line += f" {1e3 * seconds:5.1f} ms of assembly"
        if empty:
            extra = 100 * max(seconds / full - 1, 0.0) * filled / empty
            line += f"; an empty cell costs {extra:.1f} % of a full one"
        print(line)


def _in_a_larger_grid(n: int, factor: int, assembly: str) -> float:
    """Seconds of assembly for the beam in a grid `factor` times as long and as high."""
    cells = (2 * n * factor, n * factor)
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0.0, -D / 2), h=D / n, cells=cells)
    body = tawami.box(grid, (0.0, -D / 2), (L, D / 2), per_axis=2)
    law = tawami.linear_elastic(E=E, nu=NU)
    scene = tawami.Scene(grid, body, law, alpha=0.1, assembly=assembly)
    scene.fix("left", "x")
    scene.fix("left", "y")
    scene.fix("bottom", "y", lambda x, y: -1e-3 * x**2)
    scene.solve()
    stages = ("pack", "residual", "tangent")
    return sum(scene.stopwatch.seconds.get(stage, 0.0) for stage in stages)


if __name__ == "__main__":
    logging.disable(logging.INFO)  # compiling a form logs many lines
    print(json.dumps(measure(Setting(**json.loads(sys.argv[1])))), flush=True)
