"""Where the time of a Newton step goes; ratios measured in one run.

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

#: Stages of one Newton iteration, and which of them are the particles'.
STAGES = {
    "law": "strain, law, tangent at the particles (Rust)",
    "pack": "densities at quadrature points (Rust)",
    "residual": "residual (dolfinx, twice: before and after the solve)",
    "tangent": "tangent (dolfinx)",
    "reduction": "P^T K P (PETSc)",
    "scale": "scaling and test of symmetry",
    "factorise": "factorisation (MUMPS)",
    "solve": "solves (MUMPS: one, and two for the condition number)",
}
PARTICLES = ("law", "pack")
ASSEMBLY = ("pack", "residual", "tangent")


def timed(scene: tawami.Scene) -> tuple[dict[str, float], tawami.Solution]:
    """Seconds per stage of one solve, without what compiles and fills caches the first time."""
    scene.solve()
    scene.stopwatch.seconds.clear()
    scene.traction("right", (0.0, -P / D))
    solution = scene.solve()
    return dict(scene.stopwatch.seconds), solution


def in_a_larger_grid(n: int, factor: int) -> tawami.Scene:
    """The clamped beam in a grid of `factor` x `factor` its size: the rest is empty."""
    cells = (2 * n * factor, n * factor)
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0.0, -D / 2), h=D / n, cells=cells)
    body = tawami.box(grid, (0.0, -D / 2), (L, D / 2))
    scene = tawami.Scene(grid, body, tawami.linear_elastic(E=E, nu=NU), alpha=0.1)
    scene.fix("left", "x")
    scene.fix("left", "y")
    scene.fix("bottom", "y", lambda x, y: -1e-3 * x**2)
    return scene


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(prog="python -m cases.cantilever.bench", description=__doc__)
    parser.add_argument("--cells", type=int, default=128, help="cells over the height")
    n = parser.parse_args(arguments).cells
    logging.disable(logging.INFO)  # the compilation of forms is talkative
    print(header())

    start = perf_counter()
    scene = mpm.build("u_epsv", "paper", n, alpha=0.1)
    built = perf_counter() - start
    seconds, solution = timed(scene)
    total = sum(seconds[stage] for stage in STAGES)
    particles = len(scene.particles)
    print(
        f"\n{2 * n} x {n} cells, {particles} particles of "
        f"{scene.particles.bytes_per_particle} bytes, {solution.unknowns} unknowns, "
        f"{solution.iterations} Newton iteration, LDL^T: {solution.symmetric}"
    )
    print(f"  scene built in {built:.2f} s, supports and loads {seconds['set-up']:.2f} s")
    for stage, what in STAGES.items():
        print(f"  {seconds[stage]:7.3f} s {100 * seconds[stage] / total:5.1f} %  {what}")
    print(f"  {total:7.3f} s         Newton step")
    share = 100 * sum(seconds[stage] for stage in PARTICLES) / total
    print(
        f"factorisation: {100 * seconds['factorise'] / total:.0f} % of the step (aim: at least 40)"
    )
    print(f"particle stages: {share:.1f} % of the step (aim: below 10)")
    cpu = (total - seconds["factorise"] - seconds["solve"]) / particles
    print(f"all but the linear solver: {1e6 * cpu:.2f} us per particle and iteration")
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"peak memory so far: {peak:.0f} MB")

    print(
        "\nThe same beam, clamped, in a grid with empty cells, and what an empty cell costs of a full"
    )
    small = max(n // 4, 8)
    full = fastest(small, 1)
    for factor in (1, 2, 4):
        seconds = fastest(small, factor)
        empty, filled = 2 * small**2 * (factor**2 - 1), 2 * small**2
        print(
            f"  {2 * small * factor:4d} x {small * factor:4d} cells, {empty:6d} of them empty:",
            end="",
        )
        for what in seconds:
            extra = 100 * (seconds[what] / full[what] - 1) * filled / empty if empty else 0.0
            print(f"  {what} {1e3 * seconds[what]:5.1f} ms ({max(extra, 0):.1f} %)", end="")
        print()


def fastest(n: int, factor: int) -> dict[str, float]:
    """Least seconds of five runs of assembly and of P with P^T K P, in a larger grid."""
    runs = []
    for _ in range(5):
        scene = in_a_larger_grid(n, factor)
        scene.solve()
        runs.append(scene.stopwatch.seconds)
    return {
        "assembly": min(sum(seconds[stage] for stage in ASSEMBLY) for seconds in runs),
        "P and P^T K P": min(seconds["reduction"] for seconds in runs),
    }


if __name__ == "__main__":
    main()
