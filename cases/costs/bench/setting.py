"""Settings of the benchmark, and the stages of a Newton step."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import tawami

ROOT = Path(__file__).parents[3]
#: Stages of a Newton step. Each of the two assemblies has some of them.
STAGES = {
    "law": "strain, law and its tangent at the particles",
    "pack": "densities at quadrature points",
    "residual": "residual, before and after the solve",
    "measures": "measures of convergence",
    "pattern": "pattern of the reduced matrix",
    "tangent": "tangent (at the points: with reduction)",
    "reduction": "P^T K P, or the sum over ranks",
    "scale": "scaling and test of symmetry",
    "factorise": "factorisation (MUMPS)",
    "solve": "solves with the factors",
}
SOLVER = ("factorise", "solve")
PARTICLES = ("law", "pack")


@dataclass(frozen=True)
class Setting:
    """A beam to measure.

    Attributes:
        assembly: 'points' or 'dolfinx'.
        n: Cells over the height.
        per_axis: Particles per cell and axis.
        threads: Threads of the Rust part.
        ranks: Number of ranks.
    """

    assembly: str
    n: int
    per_axis: int
    threads: int
    ranks: int


def settings(
    cells: Sequence[int], per_axis: Sequence[int], threads: Sequence[int], ranks: Sequence[int]
) -> Iterator[Setting]:
    """All settings: threads on one rank, and several ranks with one thread each."""
    for n in cells:
        for m in per_axis:
            yield from (Setting("points", n, m, t, 1) for t in threads)
            yield Setting("dolfinx", n, m, max(threads), 1)
        yield from (Setting("points", n, min(per_axis), 1, r) for r in ranks if r > 1)


def in_own_process(setting: Setting) -> dict[str, Any]:
    """Measure a setting in a separate process, so that its peak memory is its own.

    Raises:
        TawamiError: The measurement failed.
    """
    command = [sys.executable, "-m", "tawami", "run", "-m", "cases.costs.bench.measure"]
    command += ["--ranks", str(setting.ranks), "--", json.dumps(asdict(setting))]
    environment = os.environ | {"RAYON_NUM_THREADS": str(setting.threads)}
    run = subprocess.run(command, env=environment, cwd=ROOT, capture_output=True, text=True,
                         timeout=600, check=False)  # fmt: skip
    if run.returncode != 0:
        raise tawami.TawamiError(f"the measurement of {setting} failed: {run.stderr[-2000:]}")
    measured: dict[str, Any] = json.loads(run.stdout.splitlines()[-1])
    return measured
