"""Pictures of a run, from its files: the particles at its end, a film of them, its tables over time."""

from __future__ import annotations

import csv
import json
import shutil
import subprocess
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import numpy.typing as npt

from tawami.base import checks
from tawami.base.errors import InputError, MissingDependencyError, OutputError
from tawami.base.files import result_folder, whole_file
from tawami.results.figure import new_figure, save
from tawami.results.provenance import RUN
from tawami.results.series import Frame, components, frames

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = npt.NDArray[np.float64]
Movie = Literal["gif", "mp4"]
#: Frames of a film at most, and how many a second.
MOST, RATE = 120, 12
#: Share of the particles of a frame whose values may lie outside the colours, half on each side.
BEYOND = 0.01
#: Map for values of both signs.
DIVERGING = "RdBu_r"
PREFIXES = (("G", 1e9), ("M", 1e6), ("k", 1e3))


def plot(
    folder: str | Path, *, quantity: str = "mean stress", movie: Movie | None = "gif"
) -> list[Path]:
    """Draw a run; the pictures go into its folder `figures`.

    Args:
        folder: Of the run, with run.json.
        quantity: By which particles are coloured, one that the run wrote: 'mean stress', 'stress xx',
            'velocity' (its size), 'velocity x', ...
        movie: 'gif', 'mp4' (needs ffmpeg), or None.

    Returns:
        The files.

    Raises:
        InputError: No run, no particles, or no such quantity in it.
        OutputError: A file of the run cannot be read, or a picture not written.
        MissingDependencyError: matplotlib is not installed, or ffmpeg for an mp4.
    """
    home = checks.path("plot: folder", folder)
    grid = _grid(home)
    if movie is not None:
        checks.choice("movie", movie, ("gif", "mp4"))
    if movie == "mp4" and shutil.which("ffmpeg") is None:
        raise MissingDependencyError("movie = 'mp4' needs ffmpeg: install it, or take movie='gif'")
    found = [(path.name, _particles(path)) for path in _phases(home)]
    series = [(name, times) for name, times in found if times]
    if not series:
        raise InputError(
            f"'{home}' holds no series of particles: expected a run with tawami.ParticleOutput(...)"
        )
    known = list(dict.fromkeys(k for _, times in series for k in _fields(times[-1][1]())))
    checks.choice("quantity", quantity, known, "the run did not write it: ")
    pictures, stem = result_folder(home / "figures"), quantity.replace(" ", "-")
    written = []
    for phase, times in series:
        if quantity in _fields(times[-1][1]()):
            film = _Film(phase, times, quantity, grid)
            written.append(film.picture(pictures / f"{phase}-{stem}.png"))
            if movie is not None and len(times) > 1:
                written.append(film.movie(pictures / f"{phase}-{stem}.{movie}", movie))
    for path in _phases(home):
        for table in sorted(path.glob("*.csv")):
            written += _table(table, pictures / f"{path.name}-{table.stem}.png")
    return written


# -- what a run has written --------------------------------------------------

Times = Sequence[tuple[float, Callable[[], Frame]]]


@dataclass(frozen=True)
class _Grid:
    """Corners of the grid [m]."""

    lower: Array
    upper: Array


def _grid(home: Path) -> _Grid:
    try:
        known = json.loads((home / RUN).read_text())["grid"]
        lower = np.array(known["origin"], dtype=float)
        return _Grid(lower, lower + known["h"] * np.array(known["cells"]))
    except FileNotFoundError:
        raise InputError(
            f"'{home}' holds no {RUN}: expected the folder of a run, as "
            "tawami.Results('results/pile', ...) makes it"
        ) from None
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise OutputError(f"'{home / RUN}' cannot be read: {error!r}") from error


def _phases(home: Path) -> list[Path]:
    """Folders of the phases, in their order in time."""
    indices = [path for kind in ("pvd", "xdmf", "csv") for path in home.glob(f"*/*.{kind}")]
    return sorted({path.parent for path in indices}, key=lambda p: (p.stat().st_ctime_ns, p.name))


def _particles(phase: Path) -> Times:
    """The first series in a folder that is one of particles."""
    for index in sorted([*phase.glob("*.pvd"), *phase.glob("*.xdmf")]):
        times = frames(index)
        if times and times[-1][1]().kind == "vertex":
            return times
    return []


def _fields(frame: Frame) -> dict[str, tuple[str, Array]]:
    """What particles can be coloured by: name -> (unit, values)."""
    found: dict[str, tuple[str, Array]] = {}
    for label, values in frame.on_points.items():
        whole, _, unit = label.removesuffix("]").rpartition(" [")
        if values.ndim == 2 and values.shape[1] == 3:
            found[whole] = (unit, np.linalg.norm(values, axis=1))
            for k, axis in enumerate("xy"):
                found[f"{whole} {axis}"] = (unit, values[:, k])
        else:
            for name, part in components(label, values).items():
                found[name.removesuffix(f" [{unit}]")] = (unit, part)
    return found


# -- particles ---------------------------------------------------------------


class _Film:
    """The particles of a phase, coloured, with colours and view that stay.

    Args:
        phase: Name of the phase.
        times: Its series.
        quantity: By which they are coloured.
        grid: The grid.
    """

    def __init__(self, phase: str, times: Times, quantity: str, grid: _Grid) -> None:
        self.phase, self.quantity = phase, quantity
        wanted = np.unique(np.linspace(0, len(times) - 1, MOST).round().astype(int))
        self.frames: list[tuple[float, Array, Array]] = []
        for k in wanted:
            time, read = times[k]
            frame = read()
            unit, values = _fields(frame)[quantity]
            self.frames.append((time, frame.points[:, :2], values))
        self.unit, self.factor = _scaled(unit, max(np.abs(v).max() for _, _, v in self.frames))
        self._draw(grid)

    def _draw(self, grid: _Grid) -> None:
        lower, upper = self._view(grid)
        width, height = upper - lower
        side = min(7.2, 7.0 * width / height)
        self.figure = new_figure(max(side, 3.2) + 0.9, side * height / width + 1.4)
        axes = self.figure.subplots()
        axes.set_aspect("equal")
        axes.set_xlim(lower[0], upper[0])
        axes.set_ylim(lower[1], upper[1])
        axes.set_xlabel("$x$ [m]")
        axes.set_ylabel("$y$ [m]")
        corners = np.array([grid.lower, [grid.upper[0], grid.lower[1]], grid.upper,
                            [grid.lower[0], grid.upper[1]], grid.lower])  # fmt: skip
        axes.plot(*corners.T, color="0.35", linewidth=1.2, zorder=1)
        low, high, colours = self._colours()
        if colours == DIVERGING:
            axes.set_facecolor("0.85")  # its middle is white
        self.points = axes.scatter([], [], c=[], linewidths=0, cmap=colours,
                                   vmin=low, vmax=high, zorder=2)  # fmt: skip
        below, above = self._outside(low, high)
        extend = "both" if below and above else "min" if below else "max" if above else "neither"
        self.figure.colorbar(
            self.points, ax=axes, orientation="horizontal", fraction=0.06, aspect=45, pad=0.02,
            extend=extend, label=f"{self.quantity} [{self.unit}]",
        )  # fmt: skip
        self.axes: Axes = axes
        self._show(*self.frames[-1])
        self.figure.draw_without_rendering()
        self.figure.set_layout_engine("none")  # the view stays from frame to frame
        per_metre = axes.transData.transform([[0, 0], [1, 0]])[:, 0]
        side = self._spacing() * float(np.ptp(per_metre)) * 72 / self.figure.dpi
        self.points.set_sizes([max(side, 1.0) ** 2])

    def _view(self, grid: _Grid) -> tuple[Array, Array]:
        """All the grid, or the part of it that the particles reach."""
        x = np.concatenate([x for _, x, _ in self.frames])
        lower, upper = x.min(axis=0), x.max(axis=0)
        margin = 0.06 * (upper - lower).max() + 1e-12
        whole = grid.upper - grid.lower
        far = whole > 2.0 * (upper - lower) + 2 * margin
        first, last = grid.lower - 0.3 * margin, grid.upper + 0.3 * margin
        return (
            np.where(far, np.maximum(lower - margin, first), first),
            np.where(far, np.minimum(upper + margin, last), last),
        )

    def _spacing(self) -> float:
        """Distance of neighbours in the first frame [m]."""
        from scipy.spatial import cKDTree

        x = self.frames[0][1]
        if len(x) < 2:
            return 0.0
        return float(np.median(cKDTree(x).query(x, k=2)[0][:, 1]))

    def _colours(self) -> tuple[float, float, str]:
        """Range and map: about 0 where the values are of both signs."""
        outer = [np.quantile(v, [BEYOND / 2, 1 - BEYOND / 2]) for _, _, v in self.frames]
        low = float(min(pair[0] for pair in outer)) / self.factor
        high = float(max(pair[1] for pair in outer)) / self.factor
        if low < 0 < high and min(-low, high) > 0.2 * max(-low, high):
            high = max(-low, high)
            return -high, high, DIVERGING
        return low, (high if high > low else low + 1e-12 + 1e-9 * abs(low)), "viridis"

    def _outside(self, low: float, high: float) -> tuple[bool, bool]:
        values = [v / self.factor for _, _, v in self.frames]
        return any(v.min() < low for v in values), any(v.max() > high for v in values)

    def _show(self, time: float, x: Array, values: Array) -> None:
        self.points.set_offsets(x)
        self.points.set_array(values / self.factor)
        self.axes.set_title(_moment(self.phase, time), fontsize=10)

    def picture(self, path: Path) -> Path:
        """The last frame."""
        self._show(*self.frames[-1])
        save(self.figure, path)
        return path

    def movie(self, path: Path, kind: Movie) -> Path:
        """All frames."""
        images = []
        for frame in self.frames:
            self._show(*frame)
            canvas: Any = self.figure.canvas
            canvas.draw()
            images.append(np.array(canvas.buffer_rgba())[:, :, :3])
        with whole_file(path) as part:
            (_gif if kind == "gif" else _mp4)(part, images)
        return path


def _gif(path: Path, images: Sequence[npt.NDArray[np.uint8]]) -> None:
    """With the colours of the last frame, so that they do not flicker."""
    from PIL import Image

    all_of_them = [Image.fromarray(image) for image in images]
    palette = all_of_them[-1].quantize(256)
    first, *others = (
        image.quantize(palette=palette, dither=Image.Dither.NONE) for image in all_of_them
    )
    durations = [1000 // RATE] * (len(images) - 1) + [1500]
    first.save(path, "GIF", save_all=True, append_images=others, duration=durations, loop=0)


def _mp4(path: Path, images: Sequence[npt.NDArray[np.uint8]]) -> None:
    height, width = images[0].shape[:2]
    command = [
        "ffmpeg", "-loglevel", "error", "-y", "-f", "rawvideo", "-pix_fmt", "rgb24",
        "-s", f"{width}x{height}", "-r", str(RATE), "-i", "-",
        "-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2", "-pix_fmt", "yuv420p", "-f", "mp4", str(path),
    ]  # fmt: skip
    run = subprocess.run(
        command,
        input=b"".join(image.tobytes() for image in images),
        capture_output=True,
        check=False,
    )
    if run.returncode:
        raise OutputError(
            f"'{path}': ffmpeg failed: {run.stderr.decode(errors='replace').strip()}; take movie='gif'"
        )


def _moment(phase: str, time: float) -> str:
    if phase.startswith("ramp"):
        return f"{100 * time:.3g} % of the load"
    if phase.startswith("settle"):
        return f"reset {time:g} of the grid"
    return f"$t$ = {time:.4g} s"


def _scaled(unit: str, most: float) -> tuple[str, float]:
    """kPa, MPa or GPa in place of Pa where numbers are large."""
    for prefix, factor in PREFIXES if unit == "Pa" else ():
        if most >= factor:
            return f"{prefix}{unit}", factor
    return unit, 1.0


# -- tables ------------------------------------------------------------------


def _table(table: Path, path: Path) -> list[Path]:
    """Columns over time, one panel for each kind; nothing where there are fewer than two rows."""
    try:
        with table.open(newline="") as file:
            head, *rows = list(csv.reader(file))
        values = np.array(rows, dtype=float).reshape(-1, len(head))
    except (OSError, ValueError) as error:
        raise OutputError(
            f"'{table}' cannot be read: {error}; expected a table of a run"
        ) from error
    if len(values) < 2:
        return []
    panels: dict[tuple[str, str], list[int]] = {}
    for k, label in enumerate(head[2:], start=2):
        panels.setdefault((label.split()[0], label[label.rindex("[") :]), []).append(k)
    if not panels:
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


def _panel(axes: Axes, head: Sequence[str], numbers: Sequence[int], values: Array) -> None:
    """Columns of one kind and unit, those that are 0 throughout left out."""
    labels = [head[k] for k in numbers]
    unit = labels[0][labels[0].rindex("[") :]
    names = [label.removesuffix(unit).strip() for label in labels]
    kind = names[0].split()[0]
    drawn = [k for k in numbers if np.any(np.nan_to_num(values[:, k]))] or numbers[:1]
    of_steps = kind in ("Newton", "step")  # the first row is no step
    for k, name in zip(numbers, names, strict=True):
        if k in drawn:
            rows = values[values[:, 0] > 0] if of_steps else values
            own = name.removeprefix(kind).strip() or name
            axes.plot(rows[:, 1], rows[:, k], "." if of_steps else "-", markersize=3, label=own)
    axes.set_xlabel(head[1].replace("time [s]", "$t$ [s]"))
    if of_steps:
        axes.set_ylim(bottom=0)
    if kind == "Newton":
        from matplotlib.ticker import MaxNLocator

        axes.yaxis.set_major_locator(MaxNLocator(integer=True))
    if len(numbers) == 1:
        axes.set_ylabel(labels[0])
    else:
        axes.set_ylabel(f"{kind} {unit}")
        axes.legend(fontsize=7, ncols=2 if len(numbers) > 4 else 1)
    axes.grid(alpha=0.3)
