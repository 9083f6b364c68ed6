"""The study of the spinning disc: what each form and transfer conserves over ten turns.

python -m cases.verification.spinning_disc
"""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace

import numpy as np

from cases.common.program import Program
from cases.common.table import as_text
from cases.verification.spinning_disc import figures
from cases.verification.spinning_disc.disc import KINDS, NU, TENSION, E, Run, solve

COLUMNS = (
    "run", "turns", "linear", "angular", "drift", "of_transfer", "energy", "highest_energy",
    "roundness", "stress_error_first", "stress_error_last", "seconds",
)  # fmt: skip


def row(run: Run) -> SimpleNamespace:
    """A run as a line of the table.

    Momenta, their changes and the energies are shares of the start; `drift` is the largest change of
    the angular momentum, `of_transfer` the part of it that the trapezoidal rule does not cause.
    """
    return SimpleNamespace(
        run=run.kind.name,
        turns=run.turns[-1],
        linear=max(run.linear),
        angular=run.angular[-1],
        drift=run.drift,
        of_transfer=run.drift_of_transfer,
        energy=run.energy[-1],
        highest_energy=max(run.energy),
        roundness=run.roundness[-1],
        stress_error_first=run.stress_error[0],
        stress_error_last=run.stress_error[-1],
        seconds=run.seconds,
    )


PROGRAM = Program("cases.verification.spinning_disc", __doc__)
PROGRAM.option("--turns", type=int, default=10, help="number of turns")


def main(arguments: Sequence[str] | None = None) -> None:
    """Spin the disc with each form and transfer, and draw the runs."""
    options = PROGRAM.start(arguments)
    if options.turns < 1:
        PROGRAM.error(f"--turns {options.turns}: expected 1 or more")
    runs = []
    for kind in KINDS:
        runs.append(solve(kind, turns=options.turns))
        print(f"{kind.name}: {runs[-1].seconds:.0f} s", flush=True)
    print(as_text([row(run) for run in runs], COLUMNS))
    turned = 2 * np.pi / runs[0].steps
    print(
        f"rho omega^2 R^2 / E = {TENSION / E:g}, nu = {NU}, {len(runs[0].radii)} particles. The "
        f"trapezoidal rule itself reduces the angular momentum by {turned**2 / 4:.1e}, at most by "
        "twice that."
    )
    figures.film([run for run in runs if run.kind.transfer != "tpic"], PROGRAM.folder / "film.png")
    figures.histories(runs, PROGRAM.folder / "histories.png")
    PROGRAM.list_results()


if __name__ == "__main__":
    PROGRAM.run(main)
