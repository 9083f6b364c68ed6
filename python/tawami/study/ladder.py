"""A ladder of runs within a budget, cheapest first: the runs that an estimate of the limit needs.

Runs are processes, as many at a time as there are cores. With several cores each uses one thread.
"""

from __future__ import annotations

import itertools
import math
import sys
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from pathlib import Path
from time import perf_counter
from typing import Any

from mpi4py import MPI

from tawami.base.errors import InputError
from tawami.base.lock import hold
from tawami.base.text import meant, quoted
from tawami.solve.memory import available
from tawami.study import process
from tawami.study.estimate import centre_of, leading, replaced
from tawami.study.knobs import Knob
from tawami.study.row import shortened, text_of
from tawami.study.stored import store, stored_runs

#: Time of a run that starts a process [s], and the ratio of times of two values of a refining knob,
#: until they are measured.
START, RATIO = 1.0, 4.0
#: Failures without a success after which a ladder ends.
HOPELESS = 3
#: A run starts next to others if the free memory is this many times that of the largest run so far.
ROOM = 3.0
Setting = tuple[Any, ...]


class Ladder:
    """Runs of a function with knobs within a budget.

    Args:
        name: Of the trade, for messages and as the label of its runs.
        run: Name of the function, see `process.name_of`.
        fingerprint: Of the function; runs with another one are repeated.
        knobs: Its knobs.
        quantities: Names of quantities; empty for all numbers that it returns.
        folder: Folder of the stored runs.
        budget: Wall time of all runs together, including stored ones [s].
        jobs: Runs at a time.

    Attributes:
        runs: Outcome of each setting that was run, in the order of the values of the knobs.
        quantities: Names of quantities.
    """

    def __init__(
        self,
        name: str,
        run: str,
        fingerprint: str,
        knobs: Sequence[Knob],
        quantities: Sequence[str],
        folder: Path,
        budget: float,
        jobs: int = 1,
    ) -> None:
        self.name, self.knobs, self.folder, self.budget = name, knobs, folder, budget
        self.jobs = 1 if "threads" in (knob.name for knob in knobs) else jobs
        self.quantities = list(quantities)
        self.runs: dict[Setting, dict[str, Any]] = {}
        self._run, self._fingerprint = run, fingerprint

    def climb(self, *, quiet: bool) -> None:
        """Run the settings that are not stored, cheapest first, until the budget is spent.

        Raises:
            InputError: Fewer than two runs succeeded, or a quantity is unknown or not a number.
        """
        lock = hold(self.folder, f"trade '{self.name}' in '{self.folder}'")
        try:
            self._load()
            self._end = perf_counter() + self.budget - self.spent / self.jobs
            with ThreadPoolExecutor(self.jobs) as pool:
                self._climb(pool, quiet)
        finally:
            lock.release()
        self.runs = {s: self.runs[s] for s in self._all() if s in self.runs}
        if len(self.succeeded) < 2:
            raise InputError(self._too_few())

    def _climb(self, pool: ThreadPoolExecutor, quiet: bool) -> None:
        """Keep all jobs busy until no setting is wanted."""
        running: dict[Future[dict[str, Any]], Setting] = {}
        while True:
            while len(running) < self.jobs:
                setting = self._next(list(running.values()))
                if setting is None or (running and not self._has_room()):
                    break
                running[pool.submit(self._measure, setting)] = setting
            if not running:
                return
            for done in wait(running, return_when=FIRST_COMPLETED).done:
                setting, outcome = running.pop(done), done.result()
                knobs = self.named(setting)
                head = {"label": self.name, "knobs": knobs, "fingerprint": self._fingerprint}
                store(self.folder, head | outcome)
                self._take(setting, outcome)
                if not quiet:
                    said = outcome.get("failure") or f"{outcome['wall_s']:.3g} s"
                    print(f"{text_of(knobs)}: {said}", file=sys.stderr, flush=True)

    def _has_room(self) -> bool:
        """Whether another run fits into the memory."""
        largest = max((run["peak_MB"] for run in self.succeeded.values()), default=0.0)
        return available(MPI.COMM_SELF) > ROOM * largest * 2**20

    @property
    def succeeded(self) -> dict[Setting, dict[str, Any]]:
        """Runs that succeeded."""
        return {setting: run for setting, run in self.runs.items() if "failure" not in run}

    @property
    def failures(self) -> dict[Setting, str]:
        """Error messages of runs that failed within the budget."""
        runs = self.runs.items()
        return {s: run["failure"] for s, run in runs if "failure" in run and "cut" not in run}

    @property
    def spent(self) -> float:
        """Wall time of all runs, one after the other [s]."""
        return float(sum(run["spent_s"] for run in self.runs.values()))

    def points(self, quantity: str) -> dict[Setting, float]:
        """Value of a quantity in each run that succeeded."""
        return {setting: run["values"][quantity] for setting, run in self.succeeded.items()}

    def estimated(self, quantity: str) -> dict[Setting, dict[str, Any]]:
        """Error of a quantity in runs that estimate it: parts and order."""
        found = {s: run.get("estimated", {}).get(quantity) for s, run in self.succeeded.items()}
        return {setting: error for setting, error in found.items() if error is not None}

    def named(self, setting: Setting) -> dict[str, Any]:
        """Setting as a mapping from names of knobs."""
        return {knob.name: value for knob, value in zip(self.knobs, setting, strict=True)}

    # -- order of runs -------------------------------------------------------------

    def _next(self, running: Sequence[Setting] = ()) -> Setting | None:
        """The cheapest setting that is wanted and fits into the budget; some are running."""
        left = self._end - perf_counter()
        failed, begun = len(self.runs) - len(self.succeeded), {*self.runs, *running}
        if left <= 0 or (failed >= HOPELESS and not self.succeeded):
            return None
        first = [s for s in self._star(centre_of(self.knobs)) if s not in begun]
        cheap = [s for s in first if len(begun) < 2 or self._cost(s) <= left / 2]
        wanted = cheap or [s for s in self._wanted() if s not in begun]
        if not wanted:
            return None
        setting = min(wanted, key=lambda s: (self._cost(s), wanted.index(s)))
        return setting if len(begun) < 2 or self._cost(setting) <= left else None

    def _all(self) -> Iterator[Setting]:
        """All settings, in the order of the values of the knobs."""
        return itertools.product(*(knob.values for knob in self.knobs))

    def _star(self, base: Setting) -> Iterator[Setting]:
        """A setting, and those that differ from it in one knob."""
        yield base
        for k, knob in enumerate(self.knobs):
            yield from (replaced(base, k, v) for v in knob.values if v != base[k])

    def _wanted(self) -> list[Setting]:
        """Lines along the knob with the largest effect, for each setting of the star."""
        star = list(self._star(centre_of(self.knobs)))
        wanted = dict.fromkeys(star)
        for quantity in self.quantities:
            k = leading(self.points(quantity), self.knobs)
            for base in star:
                wanted |= dict.fromkeys(replaced(base, k, v) for v in self.knobs[k].values)
        return list(wanted)

    def _cost(self, setting: Setting) -> float:
        """Expected wall time of a run with its process and repetitions [s]."""
        ran, base = self.succeeded, centre_of(self.knobs)
        known = {s: run["wall_s"] for s, run in ran.items()} or {base: 0.01}
        start = min((r["spent_s"] - _repeated(r["wall_s"]) for r in ran.values()), default=START)
        near = base if base in known else min(known, key=known.__getitem__)
        wall = known[near]
        for k, knob in enumerate(self.knobs):
            times = self._times(known, k)
            wall *= _time(knob, setting[k], times) / _time(knob, near[k], times)
        return max(start, 0.0) + _repeated(wall)

    def _times(self, known: Mapping[Setting, float], k: int) -> dict[int, float]:
        """Measured times along a knob through the defaults, by the place of its value."""
        base = centre_of(self.knobs)
        places = {n: replaced(base, k, v) for n, v in enumerate(self.knobs[k].values)}
        return {n: known[place] for n, place in places.items() if place in known}

    # -- runs ------------------------------------------------------------------------

    def _load(self) -> None:
        for (label, _, fingerprint), run in stored_runs(self.folder, self.name).items():
            setting = tuple(run["knobs"].get(knob.name) for knob in self.knobs)
            known = all(v in knob.values for v, knob in zip(setting, self.knobs, strict=True))
            own = label == self.name and fingerprint == self._fingerprint and known
            if (
                own
                and "cut" not in run
                and "spent_s" in run
                and self.named(setting) == run["knobs"]
            ):
                self._take(setting, run)

    def _measure(self, setting: Setting) -> dict[str, Any]:
        """Run a setting in its own process."""
        begin = perf_counter()
        threads = 1 if self.jobs > 1 else None
        limit = max(self._end - begin, 0.1)
        outcome = process.measure(self._run, self.named(setting), limit, threads)
        return outcome | {"spent_s": perf_counter() - begin}

    def _take(self, setting: Setting, run: dict[str, Any]) -> None:
        """Keep a run after a check of its quantities."""
        if "failure" not in run:
            values = run["values"]
            if not self.quantities:
                self.quantities = [q for q, v in values.items() if not isinstance(v, list)]
            for quantity in self.quantities:
                if quantity not in values:
                    raise InputError(
                        f"quantity '{quantity}' of '{self.name}': expected one of {quoted(values)}"
                        f"{meant(quantity, values)}"
                    )
                if isinstance(values[quantity], list):
                    raise InputError(
                        f"quantity '{quantity}' of '{self.name}' is a list: expected a number"
                    )
            if not self.quantities:
                raise InputError(
                    f"'{self.name}' returns no number: expected a quantity, as a number"
                )
        self.runs[setting] = run

    def _too_few(self) -> str:
        if self.failures:
            setting, message = next(iter(self.failures.items()))
            return (
                f"trade '{self.name}' finds no limit: {len(self.failures)} runs failed, the first with "
                f"{text_of(self.named(setting))}: {shortened(message)}. Expected two runs that succeed: "
                "call the function with this setting to see the whole message"
            )
        longest = max(run["spent_s"] for run in self.runs.values())
        return (
            f"budget = {self.budget:g} s is too small for two runs of '{self.name}', the longest of "
            f"which took {longest:.2g} s: expected at least {math.ceil(4 * longest)} s"
        )


def _repeated(wall: float) -> float:
    """Time of a run of this wall time with its repetitions [s]."""
    return min(process.REPEATS * wall, wall + process.SHORT)


def _time(knob: Knob, value: Any, known: Mapping[int, float]) -> float:
    """Time for a value of a knob, relative to others; extrapolated with the last ratio known."""
    place = knob.values.index(value)
    if place in known:
        return known[place]
    ratio = RATIO if knob.refines else 1.0
    if not known:
        return float(ratio**place)
    nearest = min(known, key=lambda n: abs(n - place))
    others = sorted(known, key=lambda n: abs(n - place))[:2]
    if len(others) == 2 and knob.refines:
        a, b = sorted(others)
        # short runs are mostly overhead: the ratio grows
        ratio = max(known[b] / known[a], 1.0) ** (1 / (b - a)) * (1.5 if place > b else 1.0)
    return float(known[nearest] * ratio ** (place - nearest))
