"""Speed and memory of the Newton step, stage by stage: sizes, particles per cell, threads, ranks, and
both paths of the field side. Every configuration runs in a process of its own; a table, a CSV file
and the ratios that matter come from one run.

python -m cases.costs.bench [--cells 32,64,128] [--results results/bench]
"""

from __future__ import annotations

import argparse
import csv
import json
import logging
import subprocess
import sys
import warnings
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from itertools import pairwise
from pathlib import Path
from time import perf_counter, process_time
from typing import Any

import numpy as np
from mpi4py import MPI
from ufl import div, dot, grad, inner

import tawami
from cases.verification.cantilever import mpm
from cases.verification.cantilever.beam import NU, D, E, L, P
from tawami.base.errors import InexactSumWarning
from tawami.base.files import atomic_file, result_folder
from tawami.base.program import mpirun
from tawami.fem.environment import header, peak_memory
from tawami.form.compilation import compile_form

#: Stages of a Newton step; not every path has all of them.
STAGES = {
    "law": "strain, law and its tangent at the particles",
    "pack": "densities at quadrature points",
    "residual": "residual, before and after the solve",
    "measures": "measures of convergence",
    "pattern": "pattern of the reduced matrix",
    "tangent": "tangent (fast path: densities and reduction in it)",
    "reduction": "P^T K P, or the sum over ranks",
    "scale": "scaling and test of symmetry",
    "factorise": "factorisation (MUMPS)",
    "solve": "solves with the factors",
}
SOLVER = ("factorise", "solve")
PARTICLES = ("law", "pack")


@dataclass(frozen=True)
class Setting:
    """What is measured: `n` cells over the height, `per_axis` x `per_axis` particles in each."""

    path: str
    n: int
    per_axis: int
    threads: int
    ranks: int

    def __str__(self) -> str:
        return (
            f"{self.path:9}  {2 * self.n:3} x {self.n:3}  {self.per_axis**2:3}  "
            f"{self.threads:3}  {self.ranks:3}"
        )


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure everything, print the table and the ratios, keep the CSV."""
    parser = argparse.ArgumentParser(prog="python -m cases.costs.bench", description=__doc__)
    numbers = {"cells": "32,64,128", "per_axis": "2,4", "threads": "1,2", "ranks": "1,2,4"}
    for name, default in numbers.items():
        parser.add_argument(f"--{name.replace('_', '-')}", default=default)
    parser.add_argument("--results", default="results/bench", help="folder for the results")
    parser.add_argument("--measure", help=argparse.SUPPRESS)
    options = parser.parse_args(arguments)
    logging.disable(logging.INFO)  # the compilation of forms is talkative
    if options.measure:
        measured = measure(Setting(**json.loads(options.measure)))
        if MPI.COMM_WORLD.rank == 0:
            print(json.dumps(measured), flush=True)
        return
    try:
        lists = {name: [int(v) for v in getattr(options, name).split(",")] for name in numbers}
    except ValueError:
        parser.error("expected whole numbers with commas between them, such as --cells 32,64")
    folder = result_folder(options.results)
    print(header(), flush=True)
    print(f"\n{'path':9}  {'cells':>9}  per  thr  rks" + "".join(f"{s:>10}" for s in STAGES)
          + "      step     CPU/p    all in     MB")  # fmt: skip
    print("(seconds of one Newton step; microseconds of processor time per particle and iteration, "
          "without the linear solver and in all)")  # fmt: skip
    rows = []
    for setting in settings(**lists):
        rows.append(asdict(setting) | in_its_own_process(setting))
        print(line(setting, rows[-1]), flush=True)
    keep(rows, folder / "bench.csv")
    print_ratios(rows)
    for path in ("reference", "fast"):
        empty_cells(max(max(lists["cells"]) // 4, 8), path)
    print(f"\n{folder / 'bench.csv'}")


def settings(
    cells: Sequence[int], per_axis: Sequence[int], threads: Sequence[int], ranks: Sequence[int]
) -> Iterator[Setting]:
    """All that is measured: threads on one rank, and several ranks with one thread each."""
    for n in cells:
        for m in per_axis:
            yield from (Setting("fast", n, m, t, 1) for t in threads)
            yield Setting("reference", n, m, max(threads), 1)
        yield from (Setting("fast", n, min(per_axis), 1, r) for r in ranks if r > 1)


def in_its_own_process(setting: Setting) -> dict[str, Any]:
    """Measure a setting: its peak memory is its own."""
    command = [sys.executable, "-m", "cases.costs.bench"]
    command += ["--measure", json.dumps(asdict(setting))]
    started, environment = mpirun(setting.ranks, command)
    if setting.ranks > 1:  # one rank alone would be bound to one processor
        command = started
    environment["RAYON_NUM_THREADS"] = str(setting.threads)
    root = Path(__file__).parent.parent.parent
    run = subprocess.run(command, env=environment, cwd=root, capture_output=True, text=True,
                         timeout=600, check=False)  # fmt: skip
    if run.returncode != 0:
        raise tawami.TawamiError(f"the measurement of {setting} failed: {run.stderr[-2000:]}")
    measured: dict[str, Any] = json.loads(run.stdout.splitlines()[-1])
    return measured


# -- one setting, in a process of its own ------------------------------------


def stiffening(u, eps_v, w, q, sigma, K, mu, t, h, sum_p, ds, alpha):  # type: ignore[no-untyped-def]
    """The paper's form with a stress 2 mu grad(u)^T grad(u): something to iterate on."""
    R_u = sum_p(sigma, grad(w)) - dot(t, w) * ds
    R_u += sum_p(2 * mu, inner(dot(grad(u).T, grad(u)), grad(w)))
    R_q = sum_p(K, q * (div(u) - eps_v))
    return R_u + R_q - sum_p(K**2 / mu, alpha * h**2 * dot(grad(q), grad(eps_v)))


STIFFENING = tawami.Form(
    fields={"u": ("displacement", "w"), "eps_v": ("volumetric_strain", "q")},
    kinematics="mixed",
    residual=stiffening,
    parameters={"alpha": {"default": 0.1}},
)
LOADS = 3  # of the paper's, where the form is nonlinear


def measure(setting: Setting) -> dict[str, Any]:
    """One step of the paper's beam, then one of a nonlinear beam: seconds, processor time, memory."""
    comm = MPI.COMM_WORLD
    warnings.simplefilter("ignore", InexactSumWarning)  # of the nonlinear term; the same for all
    start = perf_counter()
    form = tawami.Form.load("u_epsv")
    compile_form(comm, form, form.settings({})[1])
    forms = perf_counter() - start
    mpm.build("u_epsv", "paper", 2, alpha=0.1, assembly=setting.path).solve()  # libraries
    options: dict[str, Any] = {"alpha": 0.1, "per_axis": setting.per_axis, "assembly": setting.path}
    start, busy = perf_counter(), process_time()
    scene = mpm.build("u_epsv", "paper", setting.n, **options)
    built = perf_counter() - start
    solution = scene.solve()
    wall, cpu = perf_counter() - start, process_time() - busy
    watch = scene.stopwatch
    outside = sum(watch.cpu.get(stage, 0.0) for stage in STAGES if stage not in SOLVER)
    result: dict[str, Any] = {
        "particles": scene.num_particles,
        "unknowns": solution.unknowns,
        "deflection_m": -float(solution.displacement((L, 0.0))[1]),
        "forms_s": forms,
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
    }
    result["active_set_s"] = change_of_active_cells(scene, setting)
    del scene, solution
    mpm.build(STIFFENING, "paper", 2, alpha=0.1, assembly=setting.path).solve()  # its kernels
    scene = mpm.build(STIFFENING, "paper", setting.n, **options)
    scene.traction("right", (0.0, -(LOADS - 1) * P / D))
    busy = process_time()
    solution = scene.solve()
    cpu = comm.allreduce(process_time() - busy)
    iterations = [
        sum(now.get(stage, 0.0) - before.get(stage, 0.0) for stage in STAGES)
        for before, now in pairwise(scene.stopwatch.laps)
    ]
    later = list(zip(iterations[1:], solution.krylov[1:], strict=True))
    return result | {
        "iterations": solution.iterations,
        "krylov": list(solution.krylov),
        "first_s": iterations[0],
        "later_s": float(np.mean([s for s, k in later if 0 < k <= 3] or [np.nan])),
        "cpu_nonlinear_s": cpu,
    }


def change_of_active_cells(scene: tawami.Scene, setting: Setting) -> float:
    """Seconds of numbering, supports and pattern for another set of cells with particles."""
    body = tawami.box(scene.grid, (0.0, -D / 2), (0.75 * L, D / 2), per_axis=setting.per_axis)
    material = tawami.linear_elastic(E=E, nu=NU)
    other = tawami.Scene(scene.grid, body, material, alpha=0.1, assembly=setting.path)
    other.fix("left", "x")
    other.hold((0.0, 0.0), "y")
    other.hold((0.75 * L, 0.0), "y", -1e-3)
    other.solve()
    return sum(other.stopwatch.seconds.get(stage, 0.0) for stage in ("set-up", "pattern"))


def law_bytes(scene: tawami.Scene) -> int:
    """Bytes that the law's stage reads and writes once for this rank's particles, at least."""
    particles = scene.particles
    read = particles.stress.nbytes + particles.material.nbytes + len(particles) * (4 + 2 * 8)
    return read + sum(data.nbytes for data in scene.configuration.domain.responses.data.values())


def copy_bandwidth(threads: int) -> float:
    """GB/s of a copy from memory to memory, what is read and what is written."""
    size = 1 << 23
    pairs = [(np.ones(size), np.zeros(size)) for _ in range(threads)]
    best = np.inf
    with ThreadPoolExecutor(threads) as pool:
        for _ in range(5):
            start = perf_counter()
            list(pool.map(lambda pair: np.copyto(pair[1], pair[0]), pairs))
            best = min(best, perf_counter() - start)
    return float(threads * 2 * 8 * size / best / 1e9)


# -- what is said of them ----------------------------------------------------


def line(setting: Setting, row: dict[str, Any]) -> str:
    """A line of the table."""
    stages = "".join(f"{row[stage]:10.4f}" for stage in STAGES)
    outside, all_in = per_particle(row)
    return (
        f"{setting}{stages}{row['step_s']:10.3f}{outside:10.2f}{all_in:10.2f}{row['peak_MB']:7.0f}"
    )


def per_particle(row: dict[str, Any]) -> tuple[float, float]:
    """Microseconds of processor time per particle and Newton iteration: all but the linear solver in
    the linear step, and all of the nonlinear step, which reuses its factorisation.
    """
    micro = 1e6 / row["particles"]
    return micro * row["cpu_outside_s"], micro * row["cpu_nonlinear_s"] / row["iterations"]


def keep(rows: Sequence[dict[str, Any]], path: Path) -> None:
    """All numbers as CSV."""
    with atomic_file(path) as part, part.open("w", newline="") as file:
        writer = csv.DictWriter(file, rows[0])
        writer.writeheader()
        writer.writerows(rows)


def print_ratios(rows: Sequence[dict[str, Any]]) -> None:
    """Shares, ratios and growth, each with what was aimed at."""
    sizes = sorted({row["n"] for row in rows})
    few, many = (of(row["per_axis"] for row in rows) for of in (min, max))
    threads = max(row["threads"] for row in rows)

    def of(path: str = "fast", **wanted: int) -> list[dict[str, Any]]:
        wanted = {"n": sizes[-1], "per_axis": few, "ranks": 1} | wanted
        mine = [row for row in rows if row["path"] == path]
        return [row for row in mine if all(row[name] == value for name, value in wanted.items())]

    [fast], [reference] = of(threads=threads), of("reference")
    for row in (fast, reference):
        print_step(row)
    ratio = outside_the_solver(reference) / outside_the_solver(fast)
    print(f"\nall but the linear solver, reference over fast: {ratio:.2f}")
    print(f"forms in a warm start: {np.median([row['forms_s'] for row in rows]):.3f} s (aim: 0.1)")
    for row in of(n=64):
        print(
            f"n = 64, {row['particles']} particles, {row['threads']} threads: scene and solve "
            f"{row['solve_s']:.2f} s, peak memory {row['peak_MB']:.0f} MB (aim: 1 s, 350 MB)"
        )
    for row in of():
        print(
            f"{few**2} particles a cell, {row['threads']} threads, without the linear solver: "
            f"{per_particle(row)[0]:.2f} us per particle and iteration (aim: 5)"
        )
    for row in of(per_axis=many):
        print(
            f"{many**2} particles a cell, {row['threads']} threads, all in: "
            f"{per_particle(row)[1]:.2f} us per particle and iteration (aim: 10)"
        )
    serial = of(threads=1) or of()
    for row in rows:
        if row["n"] == sizes[-1] and row["ranks"] > 1:
            faster = serial[0]["step_s"] / row["step_s"]
            change = abs(row["deflection_m"] / serial[0]["deflection_m"] - 1)
            print(
                f"{row['ranks']} ranks: step {faster:.2f} times as fast as on one rank and thread; "
                f"deflection differs by {change:.1e}"
            )
    if len(sizes) > 1:
        print_growth([of(n=n, threads=threads)[0] for n in sizes])


def outside_the_solver(row: dict[str, Any]) -> float:
    """Seconds of a Newton step without the linear solver."""
    return float(sum(row[stage] for stage in STAGES if stage not in SOLVER))


def print_step(row: dict[str, Any]) -> None:
    """One Newton step, stage by stage."""
    print(
        f"\npath {row['path']}, {2 * row['n']} x {row['n']} cells, {row['particles']} particles, "
        f"{row['unknowns']} unknowns, {row['threads']} threads: share of the first Newton iteration"
    )
    total = row["step_s"]
    for stage, what in STAGES.items():
        print(f"  {row[stage]:8.4f} s {100 * row[stage] / total:5.1f} %  {what}")
    print(
        f"  all but the factorisation: {100 * (1 - row['factorise'] / total):.1f} % (aim: at most 25)"
    )
    share = 100 * sum(row[stage] for stage in PARTICLES) / total
    print(
        f"  particle stages: {share:.1f} %; the law's moves {row['law_GB_s']:.2f} GB/s, "
        f"{100 * row['law_GB_s'] / row['copy_GB_s']:.0f} % of what a copy reaches here "
        f"({row['copy_GB_s']:.1f} GB/s)"
    )
    later = row["later_s"] / row["first_s"]
    print(
        f"  nonlinear beam: FGMRES iterations {row['krylov']} (0: factorised); first Newton iteration "
        f"{row['first_s']:.3f} s,\n    a later one with at most 3 of these {row['later_s']:.3f} s: "
        f"{later:.2f} of the first (aim: at most 0.33)"
    )
    assembly = sum(row[stage] for stage in ("pack", "tangent", "reduction")) + row["residual"] / 2
    print(
        f"  another set of active cells (numbering, supports, pattern; 3/4 of them): "
        f"{row['active_set_s']:.3f} s; one assembly: {assembly:.3f} s (aim: less than that)"
    )


def print_growth(rows: Sequence[dict[str, Any]]) -> None:
    """Exponents of the growth with the number of particles, fitted."""
    particles = np.log([row["particles"] for row in rows])
    print("\ngrowth, seconds ~ particles^x (fast path):")
    for stage in (*STAGES, "step_s", "peak_MB"):
        values = [row[stage] for row in rows]
        if min(values) > 0:
            print(f"  {stage:10} x = {np.polyfit(particles, np.log(values), 1)[0]:.2f}")


def empty_cells(n: int, path: str) -> None:
    """Print what cells without particles cost: the beam in grids larger than itself."""
    print(f"\npath {path}: the beam, clamped, in a grid with empty cells")
    filled, full = 2 * n**2, 0.0
    for factor in (1, 2, 4):
        cells = (2 * n * factor, n * factor)
        seconds = min(assembly_in_a_larger_grid(n, factor, path) for _ in range(5))
        full = full or seconds
        empty = cells[0] * cells[1] - filled
        print(f"  {cells[0]:4d} x {cells[1]:4d} cells, {empty:6d} of them empty:", end="")
        print(f" {1e3 * seconds:5.1f} ms of assembly", end="")
        if empty:
            extra = 100 * max(seconds / full - 1, 0.0) * filled / empty
            print(f"; an empty cell costs {extra:.1f} % of a full one", end="")
        print()


def assembly_in_a_larger_grid(n: int, factor: int, path: str) -> float:
    """Seconds of assembly for the beam in a grid of `factor` x `factor` its size."""
    cells = (2 * n * factor, n * factor)
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0.0, -D / 2), h=D / n, cells=cells)
    body = tawami.box(grid, (0.0, -D / 2), (L, D / 2))
    scene = tawami.Scene(grid, body, tawami.linear_elastic(E=E, nu=NU), alpha=0.1, assembly=path)
    scene.fix("left", "x")
    scene.fix("left", "y")
    scene.fix("bottom", "y", lambda x, y: -1e-3 * x**2)
    scene.solve()
    stages = ("pack", "residual", "tangent")
    return sum(scene.stopwatch.seconds.get(stage, 0.0) for stage in stages)


if __name__ == "__main__":
    tawami.run(main, "bench")
