"""Results as files: what a run writes of particles, grid and tables in time; single files of a solution.

    tawami.ParticleOutput("stress", "velocity", every=0.01)
    tawami.GridOutput("displacement", "mean stress", every=0.05, format="xdmf")
    tawami.TableOutput("energies", "reaction left")

Names and units: `tawami.results.quantities`, `tawami.results.columns`. Series open in ParaView by
their index (.pvd or
.xdmf). A node of the grid without particles around it has no stress: NaN, which ParaView draws in its
NaN colour; a threshold of `particles [-]` from 1 leaves the cells of the body.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from tawami.base import checks, ranks
from tawami.base.errors import InputError, OutputError
from tawami.base.files import result_folder, whole_file
from tawami.grid.grid import Grid
from tawami.motion.observer import Snapshot, Subject
from tawami.results.columns import Columns, columns, usual_columns
from tawami.results.projection import Projection, check_projection, vertices
from tawami.results.quantities import (
    GridQuantity,
    Quantity,
    View,
    body_view,
    of_particles,
    on_grid,
    solution_view,
    usual_of_particles,
    usual_on_grid,
)
from tawami.results.series import Format, Frame, Series, check_format, with_z, write_vtu
from tawami.scene.solution import Solution

__all__ = [
    "GridOutput",
    "Output",
    "ParticleOutput",
    "TableOutput",
    "result_folder",
    "whole_file",
    "write_grid",
    "write_particles",
]

Array = npt.NDArray[np.float64]
SOLVED = "a tawami.Solution, as scene.solve() gives it"
#: Kinds of phases of a run.
PHASES = ("ramp", "settle", "motion")


class Output:
    """Writes what is asked for, when it is due: at the start of a phase and at its end, and in between
    at every step, every so many, or at the first one at or after each multiple of a time.

    Args:
        names: What to write; the usual by default.
        every: Time [s], or share of the load in `ramp`.
        every_steps: Number of steps, in place of a time.
        name: Of the files.
        phases: Those that are looked at, of 'ramp', 'settle' and 'motion'; all by default.

    Raises:
        InputError: Names that are none, both times and steps, or these out of their range.
    """

    def __init__(
        self,
        names: Sequence[str],
        every: float | None,
        every_steps: int | None,
        name: str,
        phases: Sequence[str] | None = None,
    ) -> None:
        if not all(isinstance(given, str) for given in names):
            raise InputError(
                f"{type(self).__name__}{checks.shown(names)}: expected names of quantities"
            )
        if every is not None and every_steps is not None:
            raise InputError("every and every_steps are both given: expected one of them")
        if not isinstance(name, str) or checks.path("name", name).name != name or not name:
            raise InputError(
                f"name = {checks.shown(name)}: expected the name of a file without its ending"
            )
        self.names, self.name = tuple(names), name
        self.phases = None if phases is None else checks.names("phases", phases, PHASES)
        self._every = None if every is None else checks.number("every", every, low=checks.LEAST)
        self._steps = checks.whole_number(
            "every_steps", 1 if every_steps is None else every_steps, low=1
        )
        self._seen = self._written = -1
        self._multiple, self._time = -math.inf, math.nan

    def begin(self, folder: Path, subject: Subject, state: dict[str, Any] | None) -> None:
        """A phase begins; a call for all ranks.

        Args:
            folder: Of the phase.
            subject: What is observed.
            state: What `state()` gave when the checkpoint was written that the run goes on from: later
                files are dropped; None for a new phase.

        Raises:
            NotModelledError, InputError: A quantity that the scene does not have, or an unknown one.
            OutputError: The folder cannot be written.
        """
        state = state or {}
        self._seen, self._written = state.get("seen", -1), state.get("written", -1)
        self._multiple = state.get("multiple", -math.inf)
        if self._every is not None and state.get("every") not in (None, self._every):
            self._multiple = self._whole(state["time"])
        self._time = state.get("time", math.nan)
        self._resolve(subject)
        comm = subject.scene.grid.comm
        with ranks.raise_together(comm):
            if comm.rank == 0:
                self._open(folder, self._seen if state else None, subject)

    def look(self, moment: Snapshot) -> None:
        """Write what is due; a call for all ranks, for every moment of a phase.

        Raises:
            OutputError: A file cannot be written; what was written before still opens.
        """
        again = moment.step <= self._seen  # of a run that goes on
        due = not again and self._due(moment)
        if due or (moment.last and self._written != moment.step):
            self._write(moment, 0.0 if moment.step == 0 else moment.time - self._time)
            self._written = moment.step
        if not again:
            self._seen, self._time = moment.step, moment.time

    def state(self) -> dict[str, Any]:
        """What a checkpoint keeps: plain numbers."""
        if self._seen < 0:
            return {}
        known: dict[str, Any] = {"seen": self._seen, "written": self._written, "time": self._time}
        if math.isfinite(self._multiple):
            known |= {"multiple": self._multiple, "every": self._every}
        return known

    def _due(self, moment: Snapshot) -> bool:
        if self._every is None:
            return moment.step % self._steps == 0
        multiple = self._whole(moment.time)
        due = multiple > self._multiple
        self._multiple = max(multiple, self._multiple)
        return due

    def _whole(self, time: float) -> int:
        """Multiples of `every` up to a time; of times that are sums of steps, 3 * 0.1 =
        0.30000000000000004 and its like.
        """
        assert self._every is not None
        return math.floor(time / self._every * (1 + 1e-12) + 1e-9)

    def _resolve(self, subject: Subject) -> None:
        """Find what the names stand for in this scene."""
        raise NotImplementedError

    def _open(self, folder: Path, last: int | None, subject: Subject) -> None:
        """Begin the files, or keep what is not later than a step; on the first rank."""
        raise NotImplementedError

    def _write(self, moment: Snapshot, size: float) -> None:
        """Write a moment, `size` after the one before; a call for all ranks."""
        raise NotImplementedError


class _SeriesOutput(Output):
    """One file a moment, and an index of them."""

    def __init__(
        self, names: Sequence[str], every: float | None, every_steps: int | None, name: str,
        phases: Sequence[str] | None, kind: str,
    ) -> None:  # fmt: skip
        super().__init__(names, every, every_steps, name, phases)
        self._format: Format = check_format(kind)

    def _open(self, folder: Path, last: int | None, subject: Subject) -> None:
        self._series = Series(folder, self.name, self._format)
        self._series.begin(last)

    def _write(self, moment: Snapshot, size: float) -> None:
        frame, comm = self._frame(moment), moment.scene.grid.comm
        with ranks.raise_together(comm):
            if comm.rank == 0:
                self._series.write(moment.step, moment.time, frame)

    def _frame(self, moment: Snapshot) -> Frame:
        raise NotImplementedError


class ParticleOutput(_SeriesOutput):
    """Particles as points, in the order of their numbers.

    Args:
        names: 'displacement', 'stress', 'mean stress', 'deviatoric stress q' (Kirchhoff's where
            strains are finite), 'volume' (at the start), 'eps_v', 'velocity', 'acceleration',
            'material', 'number', or a history variable of the laws; by default the usual ones of what
            the scene has.
        every, every_steps: When: see `Output`; every step by default.
        format: 'vtu', or 'xdmf', which takes a quarter of the time (`python -m cases.costs.writing`).
        name: Of index and folder.
        phases: As in `Output`.
    """

    def __init__(
        self,
        *names: str,
        every: float | None = None,
        every_steps: int | None = None,
        format: Literal["vtu", "xdmf"] = "vtu",
        name: str = "particles",
        phases: Sequence[str] | None = None,
    ) -> None:
        super().__init__(names, every, every_steps, name, phases, format)

    def _resolve(self, subject: Subject) -> None:
        names = self.names or usual_of_particles(subject)
        self._quantities = of_particles(names, subject)

    def _frame(self, moment: Snapshot) -> Frame:
        return _of_particles(self._quantities, body_view(moment.subject))


class GridOutput(_SeriesOutput):
    """The cells of the grid.

    Args:
        names: 'displacement' (of the last step where strains are finite), 'velocity', 'eps_v' or 'p'
            (since the start, without an initial stress), 'particles' (in each cell), 'reaction' (of
            supports and walls, shared out to the vertices, with their sum and moment), or, projected
            from the particles, 'stress', 'mean stress', 'deviatoric stress q', or a history variable;
            'eps_v' too where strains are finite.
        every, every_steps, format, name, phases: As in `ParticleOutput`.
        projection: 'lumped' or 'consistent': see `tawami.results.projection`.
    """

    def __init__(
        self,
        *names: str,
        every: float | None = None,
        every_steps: int | None = None,
        format: Literal["vtu", "xdmf"] = "vtu",
        name: str = "grid",
        phases: Sequence[str] | None = None,
        projection: Projection = "lumped",
    ) -> None:
        super().__init__(names, every, every_steps, name, phases, format)
        self._projection = check_projection(projection)

    def _resolve(self, subject: Subject) -> None:
        names = self.names or usual_on_grid(subject.scene)
        self._quantities = on_grid(names, subject, self._projection)

    def _frame(self, moment: Snapshot) -> Frame:
        return _of_grid(self._quantities, moment)


class TableOutput(Output):
    """Numbers in time as CSV: time, step, and what is asked for.

    Args:
        names: 'energies', 'momentum', 'angular momentum', 'reaction left' or another edge,
            'reaction (2, 0)' of a point held, 'displacement (2, 0)' of a point as it was at the start,
            'run-out' (the largest x), 'particles' (those that have not left), 'Newton iterations',
            'step size'.
        every, every_steps: When: see `Output`; every step by default.
        name: Of the file.
        phases: As in `Output`.
    """

    def __init__(
        self,
        *names: str,
        every: float | None = None,
        every_steps: int | None = None,
        name: str = "table",
        phases: Sequence[str] | None = None,
    ) -> None:
        super().__init__(names, every, every_steps, name, phases)

    def _resolve(self, subject: Subject) -> None:
        self._columns: list[Columns] = columns(self.names or usual_columns(subject), subject)

    def _open(self, folder: Path, last: int | None, subject: Subject) -> None:
        self.path = result_folder(folder) / f"{self.name}.csv"
        time = "pseudo-time [-]" if subject.motion is None else "time [s]"
        labels = [label for column in self._columns for label in column.labels]
        text = _line(["step [-]", time, *labels])
        if last is not None and self.path.exists():
            head, *rows = self.path.read_text().splitlines(keepends=True) or [""]
            if head != text:
                raise InputError(
                    f"'{self.path}' has the columns {head.strip()}, and {text.strip()} are asked for: "
                    "expected the same in a run that goes on; give the new table another name="
                )
            text += "".join(row for row in rows if row.endswith("\n") and _step(row) <= last)
        with whole_file(self.path) as part:
            part.write_text(text)

    def _write(self, moment: Snapshot, size: float) -> None:
        values = [float(v) for column in self._columns for v in column.of(moment, size)]
        comm = moment.scene.grid.comm
        with ranks.raise_together(comm):
            if comm.rank == 0:
                _append(self.path, _line([moment.step, float(moment.time), *values]))


def _line(values: Sequence[object]) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerow(values)
    return text.getvalue()


def _step(row: str) -> float:
    """Number of the step of a row; infinite where the row is damaged."""
    number = row.partition(",")[0]
    return int(number) if number.isdecimal() else math.inf


def _append(path: Path, line: str) -> None:
    """Add a line, or leave the file as it was.

    Raises:
        OutputError: The file cannot be written.
    """
    try:
        with path.open("ab", buffering=0) as file:
            size = file.tell()
            try:
                rest = line.encode()
                while rest:
                    rest = rest[file.write(rest) :]
            except OSError:
                file.truncate(size)
                raise
    except OSError as error:
        raise OutputError(f"'{path}' cannot be written: {error.strerror or error}") from error


# -- single files ------------------------------------------------------------


def write_particles(path: str | Path, solution: Solution) -> None:
    """Particles as VTU vertices with displacement [m], stress and mean stress [Pa], volume [m2].

    Args:
        path: File to write, ending in .vtu.
        solution: What was solved.

    Raises:
        OutputError: The file cannot be written.
    """
    checks.instance("write_particles: solution", solution, Solution, SOLVED)
    scene = solution.scene
    names = ["displacement", "stress", "mean stress", "volume"]
    names += ["eps_v"] if scene.form.kinematics.has_eps_v else []
    frame = _of_particles(of_particles(names, scene), solution_view(solution))
    _write_once(path, frame, scene.grid)


def write_grid(path: str | Path, solution: Solution) -> None:
    """Cells of the grid as VTU squares: displacement [m] and the bilinear field at the vertices,
    number of particles in each cell.

    Args:
        path: File to write, ending in .vtu.
        solution: What was solved.

    Raises:
        OutputError: The file cannot be written.
    """
    checks.instance("write_grid: solution", solution, Solution, SOLVED)
    scene = solution.scene
    now = Snapshot(scene, solution, 0.0, 0, last=True)
    _write_once(path, _of_grid(on_grid(usual_on_grid(scene), scene), now), scene.grid)


def _write_once(path: str | Path, frame: Frame, grid: Grid) -> None:
    with ranks.raise_together(grid.comm):
        if grid.comm.rank == 0:
            write_vtu(path, frame)


def _of_particles(quantities: Sequence[Quantity], view: View) -> Frame:
    x = view("x")
    data = {quantity.label: _spatial(quantity.of(view)) for quantity in quantities}
    return Frame(with_z(x), "vertex", np.arange(len(x))[:, None], data)


def _of_grid(quantities: Sequence[GridQuantity], now: Snapshot) -> Frame:
    nx, ny = now.scene.grid.cells
    corner = (np.arange(nx) + (nx + 1) * np.arange(ny)[:, None]).ravel()
    squares = corner[:, None] + np.array([0, 1, nx + 2, nx + 1])
    data: tuple[dict[str, Array], dict[str, Array]] = ({}, {})
    for quantity in quantities:
        data[quantity.cells][quantity.label] = _spatial(quantity.of(now))
    return Frame(with_z(vertices(now.scene)), "quad", squares, *data)


def _spatial(values: Array) -> Array:
    """Vectors with a third component, whole numbers as they are."""
    return with_z(values) if values.ndim == 2 and values.shape[1] == 2 else values
