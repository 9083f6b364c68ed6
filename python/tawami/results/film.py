"""Particles of a phase in colours: a picture of the end, and a movie."""

from __future__ import annotations

import subprocess
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import numpy.typing as npt

from tawami.base.arrays import Array
from tawami.base.errors import OutputError
from tawami.base.files import atomic_file
from tawami.results.figure import new_figure, save
from tawami.results.frame import Frame
from tawami.scene import quantities

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Movie = Literal["gif", "mp4"]
#: Times, and functions that read the frames.
Times = Sequence[tuple[float, Callable[[], Frame]]]
#: Frames of a movie at most, and frames per second.
MOST, RATE = 120, 12
#: Share of the particles of a frame whose values may lie outside the range of colours.
OUTLIERS = 0.01
#: Colour map for values of both signs.
DIVERGING = "RdBu_r"
PREFIXES = (("G", 1e9), ("M", 1e6), ("k", 1e3))


@dataclass(frozen=True)
class Corners:
    """Corners of the grid [m]."""

    lower: Array
    upper: Array


def scalars(frame: Frame) -> dict[str, tuple[str, Array]]:
    """What particles can be coloured by: name -> (unit, values). Of vectors these are the size and the
    components, of tensors the components, and what follows from them, as the mean stress.
    """
    return quantities.scalars(quantities.derived(frame.on_points))


class Film:
    """The particles of a phase, coloured, with one range of colours and one view for all frames.

    Args:
        phase: Name of the phase.
        times: Its series.
        quantity: What the particles are coloured by.
        grid: Corners of the grid.
    """

    def __init__(self, phase: str, times: Times, quantity: str, grid: Corners) -> None:
        self.phase, self.quantity = phase, quantity
        wanted = np.unique(np.linspace(0, len(times) - 1, MOST).round().astype(int))
        self.frames: list[tuple[float, Array, Array]] = []
        for k in wanted:
            time, read = times[k]
            frame = read()
            unit, values = scalars(frame)[quantity]
            self.frames.append((time, frame.points[:, :2], values))
        self.unit, self.factor = _scaled(
            unit, max(np.abs(v).max(initial=0.0) for _, _, v in self.frames)
        )
        self._draw(grid)

    def _draw(self, grid: Corners) -> None:
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
        self.figure.set_layout_engine("none")  # the same view in all frames
        per_metre = axes.transData.transform([[0, 0], [1, 0]])[:, 0]
        side = self._spacing() * float(np.ptp(per_metre)) * 72 / self.figure.dpi
        self.points.set_sizes([max(side, 1.0) ** 2])

    def _view(self, grid: Corners) -> tuple[Array, Array]:
        """The grid, or the part of it that the particles reach."""
        x = np.concatenate([x for _, x, _ in self.frames])
        lower, upper = x.min(axis=0), x.max(axis=0)
        margin = 0.06 * (upper - lower).max() + 1e-12
        size = grid.upper - grid.lower
        far = size > 2.0 * (upper - lower) + 2 * margin
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
        """Range and map: symmetric about 0 if the values have both signs."""
        outer = [np.quantile(v, [OUTLIERS / 2, 1 - OUTLIERS / 2]) for _, _, v in self.frames]
        low = float(min(pair[0] for pair in outer)) / self.factor
        high = float(max(pair[1] for pair in outer)) / self.factor
        if low < 0 < high and min(-low, high) > 0.2 * max(-low, high):
            high = max(-low, high)
            return -high, high, DIVERGING
        return low, (high if high > low else low + 1e-12 + 1e-9 * abs(low)), "viridis"

    def _outside(self, low: float, high: float) -> tuple[bool, bool]:
        """Whether there are values below and above the range."""
        values = [v / self.factor for _, _, v in self.frames]
        return any(v.min() < low for v in values), any(v.max() > high for v in values)

    def _show(self, time: float, x: Array, values: Array) -> None:
        self.points.set_offsets(x)
        self.points.set_array(values / self.factor)
        self.axes.set_title(_title(self.phase, time), fontsize=10)

    def picture(self, path: Path) -> Path:
        """Write the last frame."""
        self._show(*self.frames[-1])
        save(self.figure, path)
        return path

    def movie(self, path: Path, kind: Movie) -> Path:
        """Write all frames."""
        images = []
        for frame in self.frames:
            self._show(*frame)
            canvas: Any = self.figure.canvas
            canvas.draw()
            images.append(np.array(canvas.buffer_rgba())[:, :, :3])
        with atomic_file(path) as part:
            (_gif if kind == "gif" else _mp4)(part, images)
        return path


def _gif(path: Path, images: Sequence[npt.NDArray[np.uint8]]) -> None:
    """Write a GIF with the palette of the last frame for all, so that colours do not flicker."""
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
            f"'{path}': ffmpeg failed: {run.stderr.decode(errors='replace').strip()}; use movie='gif'"
        )


def _title(phase: str, time: float) -> str:
    if phase.startswith("ramp"):
        return f"{100 * time:.3g} % of the load"
    if phase.startswith("settle"):
        return f"reset {time:g} of the grid"
    return f"$t$ = {time:.4g} s"


def _scaled(unit: str, largest: float) -> tuple[str, float]:
    """kPa, MPa or GPa instead of Pa for large values, and the factor."""
    for prefix, factor in PREFIXES if unit == "Pa" else ():
        if largest >= factor:
            return f"{prefix}{unit}", factor
    return unit, 1.0
