"""Pictures of a run from its files: particles at the end, a movie of them, tables over time."""

from __future__ import annotations

import json
import os
import re
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from tawami.base import checks, csv_file
from tawami.base.arrays import Array
from tawami.base.errors import InputError, MissingDependencyError, OutputError
from tawami.base.files import readable_file, reason, result_folder
from tawami.picture import style
from tawami.picture.figure import new_figure, save
from tawami.picture.film import Movie
from tawami.picture.particles import Corners
from tawami.results.film import Times, film_of, scalars
from tawami.results.provenance import RUN
from tawami.results.series import frames

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Default quantity for the colours of particles.
USUAL = "mean stress"


def plot(
    folder: str | Path, *, quantity: str | None = None, movie: Movie | None = "gif"
) -> list[Path]:
    """Draw particles and tables of a run; the pictures go into its folder `figures`.

    Args:
        folder: Of the run, with run.json.
        quantity: Quantity for the colours, one that the run wrote: 'mean stress', 'stress xx',
            'velocity' (its size), 'velocity x', ...; by default the mean stress, or the first quantity
            of a run without stresses.
        movie: 'gif', 'mp4' (needs ffmpeg), or None.

    Returns:
        The files.

    Raises:
        InputError: No run, neither particles nor tables in it, no such quantity, or a link out of the
            folder.
        OutputError: A file of the run cannot be read, or a picture cannot be written.
        MissingDependencyError: matplotlib is not installed, or ffmpeg for an mp4.
    """
    home = checks.path("plot: folder", folder)
    _check_inside(home)
    grid = _corners(home)
    if movie is not None:
        checks.choice("movie", movie, ("gif", "mp4"))
    if movie == "mp4" and shutil.which("ffmpeg") is None:
        raise MissingDependencyError("movie = 'mp4' needs ffmpeg: install it, or use movie='gif'")
    phases = _phases(home)
    series = [(path.name, times) for path in phases if (times := _series(path, "vertex"))]
    tables = [(path, table) for path in phases for table in sorted(path.glob("*.csv"))]
    known = list(dict.fromkeys(k for _, times in series for k in scalars(times[-1][1]())))
    if not known and (quantity is not None or not tables):
        raise InputError(
            f"'{home}' holds no particles with a quantity to draw: expected a run with "
            "tawami.ParticleOutput('stress') or other quantities"
        )
    if quantity is None:
        quantity = USUAL if USUAL in known else next(iter(known), USUAL)
    else:
        checks.choice("quantity", quantity, known, "the run did not write it: ")
    pictures, stem = result_folder(home / "figures"), re.sub(r"[^\w.+]", "-", quantity)
    written = []
    for phase, times in series:
        if quantity in scalars(times[-1][1]()):
            film = film_of(phase, times, quantity, grid, _series(home / phase, "line"))
            written.append(film.picture(pictures / f"{phase}-{stem}.png"))
            if movie is not None and len(times) > 1:
                written.append(film.movie(pictures / f"{phase}-{stem}.{movie}", movie))
    for path, table in tables:
        written += _table(table, pictures / f"{path.name}-{table.stem}.png")
    return written


def _check_inside(home: Path) -> None:
    """Check that the files to read are in the folder: links could lead to any other file.

    Raises:
        InputError: A link leads out of the folder.
    """
    if not os.path.isdir(home):
        return  # reading says why
    for path in (home / RUN, *_indices(home)):
        # of os.path, since those of pathlib raise errors for paths that cannot be read
        if not Path(os.path.realpath(path)).is_relative_to(os.path.realpath(home)):
            raise InputError(
                f"plot: '{path}' is a link to '{os.path.realpath(path)}', outside the folder: expected "
                "the files of the run in its folder; copy them into it"
            )


def _indices(home: Path) -> list[Path]:
    """Series and tables of the phases."""
    return [path for ending in ("pvd", "csv") for path in home.glob(f"*/*.{ending}")]


def _corners(home: Path) -> Corners:
    """Corners of the grid of a run."""
    expected = "the folder of a run, as tawami.Results('results/pile', ...) creates it"
    file = readable_file("record of the run", home / RUN, expected)
    try:
        known = json.loads(file.read_text())["grid"]
        lower = np.array(known["origin"], dtype=float)
        return Corners(lower, lower + known["h"] * np.array(known["cells"]))
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise OutputError(f"'{file}' cannot be read: {error!r}") from error


def _phases(home: Path) -> list[Path]:
    """Folders of the phases, in their order in time."""
    return sorted(
        {path.parent for path in _indices(home)}, key=lambda p: (p.stat().st_ctime_ns, p.name)
    )


def _series(phase: Path, kind: str) -> Times:
    """The first series in a folder of particles ('vertex') or of the border ('line')."""
    for index in sorted(phase.glob("*.pvd")):
        times = frames(index)
        if times and times[-1][1]().kind == kind:
            return times
    return []


# -- tables ------------------------------------------------------------------


@style.used()
def _table(table: Path, path: Path) -> list[Path]:
    """Draw columns over time, one panel for each kind; a table needs at least two rows."""
    try:
        content = csv_file.read(table)
        head = content.header
        values = np.column_stack([content.column(k, finite=False) for k in range(len(head))])
        panels: dict[tuple[str, str], list[int]] = {}
        for k, label in enumerate(head[2:], start=2):
            panels.setdefault(_kind(label), []).append(k)
    except (OSError, ValueError) as error:
        raise OutputError(
            f"'{table}' cannot be read ({reason(error)}): expected a table of a run"
        ) from error
    if len(values) < 2 or not panels:
        return []
    across = min(2, len(panels))
    down = -(-len(panels) // across)
    figure = new_figure(5.5 * across, 3.2 * down)
    cells = list(figure.subplots(down, across, squeeze=False).ravel())
    for unused in cells[len(panels) :]:
        unused.remove()
    for axes, numbers in zip(cells, panels.values(), strict=False):
        _panel(axes, head, numbers, values)
    save(figure, path, dpi=130)
    return [path]


def _kind(label: str) -> tuple[str, str]:
    """First word and unit of a label; columns that agree in both share a panel."""
    found = re.fullmatch(r"(\S+).*(\[[^\[]*\])", label)
    if found is None:
        raise ValueError(f"its column '{label}' has no unit in brackets")
    return found[1], found[2]


def _panel(axes: Axes, head: Sequence[str], numbers: Sequence[int], values: Array) -> None:
    """Draw columns of one kind and unit, without those that are 0 throughout."""
    labels = [head[k] for k in numbers]
    kind, unit = _kind(labels[0])
    names = [label.removesuffix(unit).strip() for label in labels]
    drawn = [k for k in numbers if np.any(np.nan_to_num(values[:, k]))] or numbers[:1]
    of_steps = kind in ("Newton", "step")  # the first row is not a step
    for k, name in zip(numbers, names, strict=True):
        if k in drawn:
            rows = values[values[:, 0] > 0] if of_steps else values
            own = name.removeprefix(kind).strip() or name
            axes.plot(rows[:, 1], rows[:, k], "." if of_steps else "-", label=own)
    axes.set_xlabel(head[1].replace("time [s]", "$t$ [s]"))
    if of_steps:
        most = axes.dataLim.y1
        axes.set_ylim(0, 1.08 * most if most > 0 else None)  # points on the frame would be cut
    if kind == "Newton":
        from matplotlib.ticker import MaxNLocator

        axes.yaxis.set_major_locator(MaxNLocator(integer=True))
    if len(numbers) == 1:
        axes.set_ylabel(labels[0])
    else:
        axes.set_ylabel(f"{kind} {unit}")
        axes.legend(ncols=2 if len(numbers) > 4 else 1)
    axes.grid()
