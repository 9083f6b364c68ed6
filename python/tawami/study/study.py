"""Studies: every setting of the knobs of a function, each run once in its own process."""

from __future__ import annotations

import importlib.util
import os
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from mpi4py import MPI

from tawami.base import checks
from tawami.base.errors import InputError
from tawami.base.files import atomic_file
from tawami.base.lock import hold
from tawami.study import figure, process
from tawami.study.peers import read_peers
from tawami.study.row import COSTS, Row, error_of, text_of
from tawami.study.series import Grid, Key, Knobs, Series, is_list, knob_values
from tawami.study.stored import store, stored_runs
from tawami.study.table import Table

#: Longest time limit of a run [s]: the longest wait that the system supports.
LONGEST = 2e6


@dataclass
class Study:
    """Runs of a function for every setting of its knobs, or for a sample of the settings.

    Args:
        name: Of the study.
        function: Function to run, see `Series`; or a `Series`, with its knobs.
        knobs: Values of each knob.
        reference: Quantity -> its correct value: a number or list of numbers (the error is relative, in
            the Euclidean norm), 0 if the quantity is an error itself, or None for its value in the run
            `finest`.
        finest: Knobs of the run that the others are compared with.
        beside: Other series, compared with the same reference.
        colour: Knob whose values have colours in the picture.
        marks: Name -> setting that is marked in the picture; `...` as a value stands for any.
        peers: CSV file with results of other codes, see `tawami.study.peers`.
        folder: Folder of the stored runs and the results; results/study/NAME by default.

    Raises:
        InputError: A function that another process cannot find, knobs without values, or no reference.
    """

    name: str
    function: process.Run | Series
    knobs: Grid | Sequence[Grid] = field(default_factory=dict)
    reference: Mapping[str, Any] = field(default_factory=dict)
    finest: Knobs | None = None
    beside: Sequence[Series] = ()
    colour: str | None = None
    marks: Mapping[str, Knobs] = field(default_factory=dict)
    peers: str | Path | None = None
    folder: str | Path | None = None

    def __post_init__(self) -> None:
        self._check_types()
        own = self.function
        if not isinstance(own, Series):
            own = Series("MPM", own, self.knobs)
        self.series = (own, *self.beside)
        if len({s.label for s in self.series}) < len(self.series):
            raise InputError(f"study '{self.name}': two series of one label")
        for series in self.series:
            process.name_of(series.run)
            if not list(series.settings()):
                raise InputError(f"study '{self.name}', series '{series.label}': no knobs")
        if not self.reference:
            raise InputError(
                f"study '{self.name}' has no reference: expected a mapping from quantities to values"
            )
        self._of_finest = [q for q, value in self.reference.items() if value is None]
        if self._of_finest and self.finest is None:
            raise InputError(
                f"study '{self.name}': no reference for {', '.join(self._of_finest)}: expected a value, "
                "or the knobs of the finest run as finest=..."
            )
        self.path = checks.path("folder", self.folder or Path("results") / "study" / self.name)

    def _check_types(self) -> None:
        name = checks.shown(self.name)
        if not isinstance(self.name, str) or checks.path("name", self.name).name != self.name:
            raise InputError(f"study: name = {name}: expected text that can be a file name")
        for what, kind, expected in (
            ("reference", Mapping, "a mapping from quantities to values"),
            ("finest", Mapping | None, "the knobs of a run, or None"),
            ("colour", str | None, "the name of a knob, or None"),
            ("marks", Mapping, "a mapping from names to settings"),
            ("peers", str | Path | None, "a path, or None"),
            ("folder", str | Path | None, "a path, or None"),
        ):
            checks.instance(f"study {name}: {what}", getattr(self, what), kind, expected)
        for quantity, value in self.reference.items():
            if not isinstance(quantity, str):
                raise InputError(
                    f"study {name}: reference: {checks.shown(quantity)}: expected a name"
                )
            if value is not None:
                what = f"study {name}: reference of '{quantity}'"
                raw = checks.any_array(what, value)
                if not np.isfinite(checks.array(what, raw, raw.ndim)).all():
                    raise InputError(f"{what} = {checks.shown(value)}: expected finite numbers")
        for knob, value in (self.finest or {}).items():
            knob_values(knob, [value])
        if not is_list(self.beside) or not all(isinstance(s, Series) for s in self.beside):
            raise InputError(f"study {name}: beside = {checks.shown(self.beside)}: expected Series")

    # -- stored runs -----------------------------------------------------------

    def table(self) -> Table:
        """The stored runs, in the order of their settings.

        Raises:
            InputError: No run is stored, or the finest run failed.
        """
        runs = self._runs()
        found = [
            (series.label, setting, runs[series.key(setting)])
            for series in self.series
            for setting in series.settings()
            if series.key(setting) in runs
        ]
        if not found:
            raise InputError(f"study '{self.name}': nothing has been run: call run() first")
        reference = self._reference(runs)
        return Table(self.name, [_row(*one, reference) for one in found])

    def _reference(self, runs: Mapping[Key, Mapping[str, Any]]) -> dict[str, Any]:
        reference = dict(self.reference)
        if not self._of_finest:
            return reference
        assert self.finest is not None
        finest = runs.get(self.series[0].key(self.finest))
        if finest is None or "failure" in finest:
            why = "has not been run" if finest is None else finest["failure"]
            raise InputError(f"study '{self.name}': the finest run, {dict(self.finest)}: {why}")
        for quantity in self._of_finest:
            if quantity not in finest["values"]:
                raise InputError(f"study '{self.name}': no quantity '{quantity}' in the finest run")
            reference[quantity] = finest["values"][quantity]
        return reference

    def _runs(self) -> dict[Key, dict[str, Any]]:
        """Stored runs by label, setting and fingerprint."""
        return stored_runs(self.path, self.name)

    # -- running -----------------------------------------------------------------

    def run(
        self,
        *,
        sample: int | None = None,
        seed: int = 0,
        limit: float = 1800.0,
        quiet: bool = False,
    ) -> Table:
        """Run the settings that are not stored yet, one after the other, each in its own process.

        A stored run is repeated if the function, tawami or the machine has changed, or if its process
        was ended before it was done.

        Args:
            sample: Number of settings drawn at random, instead of all.
            seed: Of the draw.
            limit: Largest wall time of a run [s]; a run that takes longer fails.
            quiet: Do not print a line for each run.

        Returns:
            All stored runs; NAME.csv and NAME.png in the folder show them too.

        Raises:
            InputError: No reference for a quantity, the finest run failed, or another process runs the
                study in this folder. Other runs may fail: the table has their error messages.
        """
        checks.whole_number("seed", seed, low=0)
        limit = checks.number("limit", limit, low=checks.LEAST, high=LONGEST)
        quiet = checks.switch("quiet", quiet)
        if process.MARK in os.environ:
            raise InputError(
                f"study '{self.name}' was started again by its own run: put study.run() under "
                'if __name__ == "__main__":'
            )
        if MPI.COMM_WORLD.size > 1:
            raise InputError(
                f"study '{self.name}' on {MPI.COMM_WORLD.size} ranks: expected one rank; each run has "
                "its own process"
            )
        lock = hold(self.path, f"study '{self.name}' in '{self.path}'")
        try:
            return self._run(self._work(sample, seed), limit, quiet)
        finally:
            lock.release()

    def _run(
        self, wanted: Sequence[tuple[Series, dict[str, Any]]], limit: float, quiet: bool
    ) -> Table:
        """Run the settings of a list that are not stored yet; the folder is locked."""
        folder, runs = self.path, self._runs()
        done = {key for key, run in runs.items() if "cut" not in run}
        work = [(s, k) for s, k in wanted if s.key(k) not in done]
        start = perf_counter()
        for number, (series, setting) in enumerate(work):
            outcome = process.measure(process.name_of(series.run), setting, limit)
            head = {"label": series.label, "knobs": setting, "fingerprint": series.fingerprint}
            store(folder, head | outcome)
            if not quiet:
                left = (perf_counter() - start) / (number + 1) * (len(work) - number - 1)
                said = outcome.get("failure") or f"{outcome['wall_s']:.3g} s"
                print(
                    f"[{number + 1}/{len(work)}] {series.label}: {text_of(setting)}: {said}; "
                    f"{left / 60:.1f} min left",
                    file=sys.stderr, flush=True,
                )  # fmt: skip
        table = self.table()
        with atomic_file(folder / f"{self.name}.csv") as part:
            part.write_text(table.as_csv())
        if not table.quantities:
            print(f"study '{self.name}': no run succeeded", file=sys.stderr)
        elif importlib.util.find_spec("matplotlib") is not None:
            self.draw(table, folder / f"{self.name}.png")
        elif not quiet:
            print(f"study '{self.name}': no picture without matplotlib", file=sys.stderr)
        return table

    def draw(self, table: Table, path: str | Path) -> None:
        """Draw a table with the colours, marks and peers of the study."""
        peers = read_peers(self.peers) if self.peers is not None else []
        figure.picture(table, path, colour=self.colour, marks=self.marks, peers=peers)

    def _work(self, sample: int | None, seed: int) -> list[tuple[Series, dict[str, Any]]]:
        work = [(series, setting) for series in self.series for setting in series.settings()]
        if sample is not None:
            count = min(checks.whole_number("sample", sample, low=1), len(work))
            chosen = np.random.default_rng(seed).choice(len(work), count, replace=False)
            work = [work[k] for k in sorted(chosen)]
        if self._of_finest:
            assert self.finest is not None
            finest = (self.series[0], dict(self.finest))
            work = [finest, *(job for job in work if job != finest)]
        return work


def _row(label: str, setting: Knobs, run: Mapping[str, Any], reference: Mapping[str, Any]) -> Row:
    if "failure" in run:
        return Row(label, dict(setting), {}, {}, {}, run["failure"])
    values = run["values"]
    missing = [quantity for quantity in reference if quantity not in values]
    if missing:
        raise InputError(
            f"{label}: {text_of(setting)}: its function returned no quantity "
            f"{', '.join(map(repr, missing))}, only {', '.join(map(repr, values))}"
        )
    errors = {q: error_of(values[q], value) for q, value in reference.items()}
    scalars = {name: float(value) for name, value in values.items() if np.ndim(value) == 0}
    return Row(label, dict(setting), scalars, errors, {cost: run[cost] for cost in COSTS}, None)
