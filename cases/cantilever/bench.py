"""Where the time of a Newton step goes, on both paths of the field side; ratios from one run.

python -m cases.cantilever.bench [--cells 128]
"""

from __future__ import annotations

import argparse
import logging
import resource
from collections.abc import Sequence
from time import perf_counter

from mpi4py import MPI

import tawami
from cases.cantilever import mpm
from cases.cantilever.beam import NU, D, E, L, P
from tawami.environment import header

#: Stages of one Newton iteration.
SOLVER = {
    "scale": "scaling and test of symmetry",
    "factorise": "factorisation (MUMPS)",
    "solve": "solves (MUMPS: one, and two for the condition number)",
}
STAGES = {
    "reference": {
        "law": "strain, law, tangent at the particles (Rust)",
        "pack": "densities at quadrature points (Rust)",
        "residual": "residual (dolfinx), before and after the solve",
        "tangent": "tangent (dolfinx)",
        "reduction": "P^T K P (PETSc)",
        **SOLVER,
    },
    "fast": {
        "law": "strain, law, tangent at the particles (Rust)",
        "residual": "densities, kernels, residual (Rust), before and after the solve",
        "pattern": "pattern of the reduced matrix (Rust)",
        "tangent": "densities, kernels, reduced tangent (Rust)",
        **SOLVER,
    },
}
PARTICLES = ("law", "pack")


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(prog="python -m cases.cantilever.bench", description=__doc__)
    parser.add_argument("--cells", type=int, default=128, help="cells over the height")
    n = parser.parse_args(arguments).cells
    logging.disable(logging.INFO)  # the compilation of forms is talkative
    print(header())
    outside = {path: newton_step(n, path) for path in STAGES}
    ratio = outside["reference"] / outside["fast"]
    print(f"\nall but the linear solver, reference over fast: {ratio:.2f}")
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"peak memory, both paths in one process: {peak:.0f} MB")
    for path in STAGES:
        empty_cells(max(n // 4, 8), path)


def newton_step(n: int, path: str) -> float:
    """Print the stages of one Newton step of the beam; seconds of all but the linear solver."""
    start = perf_counter()
    scene = mpm.build("u_epsv", "paper", n, alpha=0.1, assembly=path)
    built = perf_counter() - start
    scene.solve()  # what compiles and fills caches the first time is not counted
    scene.stopwatch.seconds.clear()
    scene.traction("right", (0.0, -P / D))
    solution = scene.solve()
    seconds, stages, particles = scene.stopwatch.seconds, STAGES[path], len(scene.particles)
    total = sum(seconds[stage] for stage in stages)
    outside = total - seconds["factorise"] - seconds["solve"]
    print(
        f"\nassembly='{path}': {2 * n} x {n} cells, {particles} particles of "
        f"{scene.particles.bytes_per_particle} bytes, {solution.unknowns} unknowns, "
        f"{solution.iterations} Newton iteration, LDL^T: {solution.symmetric}\n"
        f"  scene built in {built:.2f} s, supports and loads {seconds['set-up']:.2f} s"
    )
    for stage, what in stages.items():
        print(f"  {seconds[stage]:7.3f} s {100 * seconds[stage] / total:5.1f} %  {what}")
    print(f"  {total:7.3f} s         Newton step")
    factor = 100 * seconds["factorise"] / total
    print(f"factorisation: {factor:.0f} % of the step (aim: at least 40)")
    if path == "reference":
        share = 100 * sum(seconds[stage] for stage in PARTICLES) / total
        print(f"particle stages: {share:.1f} % of the step (aim: below 10)")
    print(f"all but the linear solver: {1e6 * outside / particles:.2f} us per particle")
    return outside


def empty_cells(n: int, path: str) -> None:
    """Print what cells without particles cost: the beam in grids larger than itself."""
    print(f"\nassembly='{path}': the beam, clamped, in a grid with empty cells")
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
    main()
