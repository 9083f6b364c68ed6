"""The lines that the benchmark prints: a table, then shares and ratios, each with its aim."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from cases.costs.bench.setting import PARTICLES, SOLVER, STAGES

Row = dict[str, Any]

HEADER = (
    f"\n{'assembly':9}  {'cells':>9}  per  thr  rks"
    + "".join(f"{stage:>10}" for stage in STAGES)
    + "      step     CPU/p    all in     MB\n"
    "(seconds of one Newton step; CPU/p and all in: microseconds of processor time per particle and "
    "iteration, without and with the linear solver; per: particles per cell, thr: threads, rks: ranks)"
)


def line(row: Row) -> str:
    """A line of the table."""
    stages = "".join(f"{row[stage]:10.4f}" for stage in STAGES)
    outside, all_in = per_particle(row)
    return (
        f"{row['assembly']:9}  {2 * row['n']:3} x {row['n']:3}  {row['per_axis'] ** 2:3}  "
        f"{row['threads']:3}  {row['ranks']:3}{stages}{row['step_s']:10.3f}{outside:10.2f}"
        f"{all_in:10.2f}{row['peak_MB']:7.0f}"
    )


def per_particle(row: Row) -> tuple[float, float]:
    """Microseconds of processor time per particle and Newton iteration.

    Returns:
        The linear step without the linear solver; the whole nonlinear step, which reuses its
        factorisation.
    """
    micro = 1e6 / row["particles"]
    return micro * row["cpu_outside_s"], micro * row["cpu_nonlinear_s"] / row["iterations"]


def print_ratios(rows: Sequence[Row]) -> None:
    """Print shares, ratios and growth of the largest size, each with its aim."""
    sizes = sorted({row["n"] for row in rows})
    few, many = (of(row["per_axis"] for row in rows) for of in (min, max))
    threads = max(row["threads"] for row in rows)

    def of(assembly: str = "points", **wanted: int) -> list[Row]:
        wanted = {"n": sizes[-1], "per_axis": few, "ranks": 1} | wanted
        mine = [row for row in rows if row["assembly"] == assembly]
        return [row for row in mine if all(row[name] == value for name, value in wanted.items())]

    [points], [reference] = of(threads=threads), of("dolfinx")
    for row in (points, reference):
        print_step(row)
    ratio = outside_the_solver(reference) / outside_the_solver(points)
    print(f"\nall but the linear solver, dolfinx over points: {ratio:.2f}")
    first = np.median([row["forms_s"] for row in rows])
    print(f"first scene of a process, with form and kernels: {first:.3f} s (aim: 0.1)")
    for row in of(n=64):
        print(
            f"n = 64, {row['particles']} particles, {row['threads']} threads: scene and solve "
            f"{row['solve_s']:.2f} s, peak memory {row['peak_MB']:.0f} MB (aim: 1 s, 350 MB)"
        )
    for row in of():
        print(
            f"{few**2} particles per cell, {row['threads']} threads, without the linear solver: "
            f"{per_particle(row)[0]:.2f} us per particle and iteration (aim: 5)"
        )
    for row in of(per_axis=many):
        print(
            f"{many**2} particles per cell, {row['threads']} threads, with the linear solver: "
            f"{per_particle(row)[1]:.2f} us per particle and iteration (aim: 10)"
        )
    serial = of(threads=1) or of()
    print_ranks([row for row in rows if row["n"] == sizes[-1] and row["ranks"] > 1], serial[0])
    if len(sizes) > 1:
        print_growth([of(n=n, threads=threads)[0] for n in sizes])


def outside_the_solver(row: Row) -> float:
    """Seconds of a Newton step without the linear solver."""
    return float(sum(row[stage] for stage in STAGES if stage not in SOLVER))


def print_step(row: Row) -> None:
    """Print one Newton step, stage by stage."""
    print(
        f"\nassembly {row['assembly']}, {2 * row['n']} x {row['n']} cells, {row['particles']} "
        f"particles, {row['unknowns']} unknowns, {row['threads']} threads: share of the first Newton "
        "iteration"
    )
    total = row["step_s"]
    for stage, what in STAGES.items():
        print(f"  {row[stage]:8.4f} s {100 * row[stage] / total:5.1f} %  {what}")
    print(
        f"  all but the factorisation: {100 * (1 - row['factorise'] / total):.1f} % (aim: at most 25)"
    )
    share = 100 * sum(row[stage] for stage in PARTICLES) / total
    print(
        f"  particle stages: {share:.1f} %; the law moves {row['law_GB_s']:.2f} GB/s, "
        f"{100 * row['law_GB_s'] / row['copy_GB_s']:.0f} % of a plain copy on this machine "
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


def print_ranks(rows: Sequence[Row], serial: Row) -> None:
    """Print the speed-up on several ranks."""
    for row in rows:
        faster = serial["step_s"] / row["step_s"]
        change = abs(row["deflection_m"] / serial["deflection_m"] - 1)
        print(
            f"{row['ranks']} ranks: step {faster:.2f} times as fast as on one rank and thread; "
            f"the deflection differs by {change:.1e}"
        )


def print_growth(rows: Sequence[Row]) -> None:
    """Print fitted exponents of the growth with the number of particles."""
    particles = np.log([row["particles"] for row in rows])
    print("\ngrowth, seconds ~ particles^x (assembly at the points):")
    for stage in (*STAGES, "step_s", "peak_MB"):
        values = [row[stage] for row in rows]
        if min(values) > 0:
            print(f"  {stage:10} x = {np.polyfit(particles, np.log(values), 1)[0]:.2f}")
