"""Two checkouts compared in one run.

Each checkout has a process of its own. The two take their steps in turns, A B A B, so that disturbances
affect both alike. The ratio new over old is taken for each pair of steps; the result is the median over
all pairs. Every round starts new processes.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO

import numpy as np

import tawami
from cases.common.program import progress
from cases.costs.bench.setting import ROOT

#: Stages that are also reported together, by the name of the row.
GROUPS = {
    "residual calls": ("law", "pack", "residual"),
    "tangent calls": ("pattern", "tangent", "reduction"),
    "linear solver": ("scale", "factorise", "solve"),
}
#: Particles of a scene from which fewer pairs of steps are taken.
LARGE = 4000
#: Stages shorter than this are not reported, because the clock dominates them [s].
SHORTEST = 5e-6

COLUMNS = ("scene", "stage", "new_ms", "old_ms", "ratio", "low", "high")

Seconds = Mapping[str, float]


@dataclass(frozen=True)
class Row:
    """One stage of a scene: medians over all pairs of steps.

    Attributes:
        scene: Name of the scene.
        stage: Stage of the step.
        new_ms, old_ms: Milliseconds of processor time in a step, of this checkout and of the other.
        ratio, low, high: New over old: median and quartiles.
    """

    scene: str
    stage: str
    new_ms: float
    old_ms: float
    ratio: float
    low: float
    high: float


def python_of(checkout: Path) -> str:
    """The interpreter of a checkout: that of its `.venv`, or the one that runs.

    Raises:
        InputError: The checkout has not been set up.
    """
    if not list((checkout / "python" / "tawami").glob("_rust*.so")):
        raise tawami.InputError(
            f"--against {checkout}: python/tawami/_rust*.so was not found: expected a checkout of "
            "tawami that has been set up; run make setup in it"
        )
    own = checkout / ".venv" / "bin" / "python"
    return str(own) if own.exists() else sys.executable


class Checkout:
    """A process that takes steps with the package of a checkout.

    Args:
        path: Root of the checkout.
        process: The process of `timed`.
        errors: File for its standard error.

    Raises:
        TawamiError: The process failed, or imported the package from elsewhere.
    """

    def __init__(self, path: Path, process: subprocess.Popen[str], errors: IO[str]) -> None:
        self._path, self._process, self._errors = path, process, errors
        package = self._answer()["package"]
        if not Path(package).resolve().is_relative_to(path.resolve()):
            raise tawami.TawamiError(
                f"{path}: its process imported {package}: expected the package of the checkout"
            )

    def step(self, scene: str) -> Seconds:
        """Take a step of a scene: seconds by stage."""
        assert self._process.stdin is not None
        self._process.stdin.write(f"{scene}\n")
        self._process.stdin.flush()
        seconds: Seconds = self._answer()
        return seconds

    def _answer(self) -> dict:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line:
            self._process.wait()
            self._errors.seek(0)
            raise tawami.TawamiError(
                f"the measurement of {self._path} failed: {self._errors.read()[-2000:]}"
            )
        return json.loads(line)


@contextmanager
def started(path: Path, threads: int, kernels: str = "") -> Iterator[Checkout]:
    """Start the process of a checkout, with kernels of OpenBLAS; it ends with the block."""
    environment = os.environ | {
        "PYTHONPATH": str(path / "python"),
        "RAYON_NUM_THREADS": str(threads),
    }
    if kernels:
        environment["OPENBLAS_CORETYPE"] = kernels
    command = [python_of(path), str(Path(__file__).with_name("timed.py"))]
    with (
        tempfile.TemporaryFile("w+") as errors,
        subprocess.Popen(
            command, env=environment, cwd=path, text=True, stdin=subprocess.PIPE,
            stdout=subprocess.PIPE, stderr=errors,
        ) as process,
    ):  # fmt: skip
        yield Checkout(path, process, errors)


def compare(
    other: Path,
    cells: Sequence[int],
    particles: Sequence[int],
    *,
    rounds: int,
    pairs: int,
    threads: int,
    kernels: str = "",
) -> Iterator[Row]:
    """Compare this checkout with another one.

    Args:
        other: Root of the other checkout.
        cells: Sizes of the beam, in cells over the height.
        particles: Sizes of the pile, in particles.
        rounds: Number of times that new processes start.
        pairs: Pairs of steps of each scene in a round, fewer of a large one.
        threads: Threads of the Rust part.
        kernels: Core type that the other checkout's OpenBLAS uses.
    """
    python_of(other)  # fails before anything is measured
    sizes = {f"beam {n}": 8 * n**2 for n in cells} | {f"collapse {n}": n for n in particles}
    scenes = {scene: max(1, pairs // max(1, size // LARGE)) for scene, size in sizes.items()}
    found: dict[str, list[tuple[Seconds, Seconds]]] = {scene: [] for scene in scenes}
    for _ in progress(range(rounds), desc="bench", unit="round"):
        with ExitStack() as stack:
            new = stack.enter_context(started(ROOT, threads))
            old = stack.enter_context(started(other, threads, kernels))
            for scene, number in scenes.items():
                found[scene] += [(new.step(scene), old.step(scene)) for _ in range(number)]
    for scene, steps in found.items():
        yield from rows_of(scene, steps)


def rows_of(scene: str, steps: Sequence[tuple[Seconds, Seconds]]) -> Iterator[Row]:
    """One row for each stage that both checkouts have, then for groups and the whole step."""
    new, old = steps[-1]
    stages = {stage: (stage,) for stage in new if stage in old and stage != "whole step"}
    for name, parts in (stages | GROUPS | {"whole step": ("whole step",)}).items():
        times = np.array(
            [[sum(s.get(part, 0.0) for part in parts) for s in pair] for pair in steps]
        )
        if (np.median(times, axis=0) > SHORTEST).all():
            low, ratio, high = np.quantile(times[:, 0] / times[:, 1], [0.25, 0.5, 0.75])
            yield Row(scene, name, *(1e3 * np.median(times, axis=0)), ratio, low, high)
