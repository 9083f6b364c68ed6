"""What a study runs: functions with knobs, each setting once, in a process of its own."""

from __future__ import annotations

import functools
import importlib.util
import itertools
import json
import os
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from mpi4py import MPI

from tawami.base import checks
from tawami.base.errors import InputError, OutputError
from tawami.base.files import atomic_file, result_folder
from tawami.study import process
from tawami.study.table import COSTS, Row, Table, error_of, text_of

Knobs = Mapping[str, Any]
Grid = Mapping[str, Sequence[Any]]
#: Label, setting and fingerprint.
Key = tuple[str, str, str]
#: Longest limit of a run [s]: what the system waits for at most.
LONGEST = 2e6


@dataclass(frozen=True)
class Series:
    """A function with the knobs it is run with; the finite elements beside the particles, say.

    Args:
        label: What the picture calls it.
        run: Function at the top level of a file: takes knobs by name and returns a mapping from names of
            quantities to numbers or lists of numbers. Newton iterations, steps and unknowns are counted;
            'newton_iterations', 'steps' or 'unknowns' among the quantities count instead.
        knobs: Values of each knob: their grid. Or several of these: the settings of all of them.
    """

    label: str
    run: process.Run
    knobs: Grid | Sequence[Grid]

    def __post_init__(self) -> None:
        if not isinstance(self.label, str):
            raise InputError(f"label = {checks.shown(self.label)}: expected the name of a series")
        grids = self.knobs if _is_list(self.knobs) else [self.knobs]
        named = (isinstance(g, Mapping) and all(isinstance(n, str) for n in g) for g in grids)
        if len(grids) == 0 or not all(named):
            raise InputError(
                f"series '{self.label}': knobs = {checks.shown(self.knobs)}: expected a mapping from "
                "names of knobs to their values, or a list of such"
            )

    @functools.cached_property
    def fingerprint(self) -> str:
        """What its measurements depend on besides the knobs."""
        return process.fingerprint(self.run)

    def key(self, setting: Knobs) -> Key:
        """What a kept run of a setting is found by."""
        return self.label, _text(setting), self.fingerprint

    def settings(self) -> Iterator[dict[str, Any]]:
        """Every setting once, in the order in which knobs and values were given."""
        grids = [self.knobs] if isinstance(self.knobs, Mapping) else self.knobs
        known = set()
        for grid in grids:
            for values in itertools.product(*(_values(*knob) for knob in grid.items())):
                setting = dict(zip(grid, values, strict=True))
                if _text(setting) not in known:
                    known.add(_text(setting))
                    yield setting


def _values(name: str, values: Any) -> Sequence[Any]:
    if not _is_list(values) or len(values) == 0:
        raise InputError(f"knob '{name}' = {checks.shown(values)}: expected a list of its values")
    if not all(isinstance(v, str | bool | int | float | None) for v in values):
        raise InputError(
            f"knob '{name}' = {checks.shown(values)}: expected numbers, names, booleans or None"
        )
    return list(values)


def _is_list(value: Any) -> bool:
    if isinstance(value, np.ndarray):
        return value.ndim > 0
    return isinstance(value, Sequence) and not isinstance(value, checks.TEXT)


def _text(setting: Knobs) -> str:
    return json.dumps(setting, sort_keys=True)


@dataclass
class Study:
    """Runs every setting of its knobs, or a sample of them, and keeps what came out.

    Args:
        name: Of the study.
        function: What is run, see `Series`; or a `Series` itself, with its knobs.
        knobs: Values of each knob.
        reference: Quantity -> what it should be: a number or list of numbers (the error is relative to
            it, in the norm of Euclid), 0 where the quantity is an error itself, or None: as in the run
            `finest`.
        finest: Knobs of the run that others are compared with.
        beside: Other series, compared with the same reference.
        colour: Knob whose values have colours in the picture.
        folder: Where runs are kept and results are written; results/study/NAME by default.

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
            raise InputError(f"study: name = {name}: expected text that a file can be named by")
        for what, kind, expected in (
            ("reference", Mapping, "a mapping from quantities to values"),
            ("finest", Mapping | None, "the knobs of a run, or None"),
            ("colour", str | None, "the name of a knob, or None"),
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
            _values(knob, [value])
        if not _is_list(self.beside) or not all(isinstance(s, Series) for s in self.beside):
            raise InputError(f"study {name}: beside = {checks.shown(self.beside)}: expected Series")

    # -- what has been run -----------------------------------------------------

    def table(self) -> Table:
        """What has been run so far, settings in order.

        Raises:
            InputError: Nothing has, or the finest run failed.
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
        """Kept runs by label, setting and fingerprint; a last line that was cut off does not count."""
        path, runs = self.path / "runs.jsonl", dict[Key, dict[str, Any]]()
        try:
            lines = path.read_text(errors="replace").splitlines()
        except FileNotFoundError:
            return runs
        except OSError as error:
            raise InputError(f"study '{self.name}': '{path}': {error.strerror}") from None
        for line in lines:
            try:
                run = json.loads(line)
                runs[run["label"], _text(run["knobs"]), run["fingerprint"]] = run
            except (ValueError, TypeError, KeyError):
                continue
        return runs

    # -- running -----------------------------------------------------------------

    def run(
        self,
        *,
        sample: int | None = None,
        seed: int = 0,
        limit: float = 1800.0,
        quiet: bool = False,
    ) -> Table:
        """Run what has not been run, one process each, one after the other.

        What is there already is not run again, unless the function, tawami or the machine has changed,
        or its process was ended before it was done.

        Args:
            sample: Number of settings drawn at random, instead of all.
            seed: Of the draw.
            limit: Wall time of a run [s]; one that takes longer counts as failed.
            quiet: Whether to print no line for each run.

        Returns:
            All that has been run so far; NAME.csv and NAME.png in the folder hold it too.

        Raises:
            InputError: No reference for a quantity, or the finest run failed. Other runs may fail: the
                table has their sentence.
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
                f"study '{self.name}' on {MPI.COMM_WORLD.size} ranks: expected one; each run has a "
                "process of its own"
            )
        folder, runs = result_folder(self.path), self._runs()
        done = {key for key, run in runs.items() if "cut" not in run}
        work = [(s, k) for s, k in self._work(sample, seed) if s.key(k) not in done]
        start = perf_counter()
        for number, (series, setting) in enumerate(work):
            outcome = process.measured(process.name_of(series.run), setting, limit)
            head = {"label": series.label, "knobs": setting, "fingerprint": series.fingerprint}
            _append(folder / "runs.jsonl", json.dumps(head | outcome))
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
            table.draw(folder / f"{self.name}.png", colour=self.colour)
        elif not quiet:
            print(f"study '{self.name}': no picture without matplotlib", file=sys.stderr)
        return table

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


def _append(path: Path, line: str) -> None:
    """One more line; one that was cut off before it is ended first."""
    size = None
    try:
        with path.open("a+b") as file:
            size = file.tell()
            if size:
                file.seek(-1, os.SEEK_END)
                line = line if file.read(1) == b"\n" else "\n" + line
            file.write((line + "\n").encode())
            file.flush()
            os.fsync(file.fileno())
    except OSError as error:
        if size is not None:
            with suppress(OSError):
                os.truncate(path, size)
        raise OutputError(f"'{path}' cannot be written: {error.strerror or error}") from error


def _row(label: str, setting: Knobs, run: Mapping[str, Any], reference: Mapping[str, Any]) -> Row:
    if "failure" in run:
        return Row(label, dict(setting), {}, {}, {}, run["failure"])
    values = run["values"]
    missing = [quantity for quantity in reference if quantity not in values]
    if missing:
        raise InputError(
            f"{label}: {text_of(setting)}: no quantity {', '.join(map(repr, missing))} among what its "
            f"function returned: {', '.join(map(repr, values))}"
        )
    errors = {q: error_of(values[q], value) for q, value in reference.items()}
    scalars = {name: float(value) for name, value in values.items() if np.ndim(value) == 0}
    return Row(label, dict(setting), scalars, errors, {cost: run[cost] for cost in COSTS}, None)
