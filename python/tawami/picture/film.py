"""Films of particles: pictures, movies, and animations that a notebook plays."""

from __future__ import annotations

import re
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import numpy.typing as npt

from tawami.base.arrays import Array
from tawami.base.errors import OutputError
from tawami.base.files import atomic_file
from tawami.picture import style
from tawami.picture.figure import lay_out, new_figure, save
from tawami.picture.particles import Corners, Scale, Squares, draw_border, draw_frame, size_of, view

if TYPE_CHECKING:
    from matplotlib.animation import FuncAnimation

Movie = Literal["gif", "mp4"]
#: Signs in place of the icons of matplotlib's player, which come from the web.
ICONS = {
    "minus": "-", "fast-backward": "&#8676;", "step-backward": "&lsaquo;",
    "play fa-flip-horizontal": "&#9664;", "pause": "||", "play": "&#9654;", "step-forward": "&rsaquo;",
    "fast-forward": "&#8677;", "plus": "+",
}  # fmt: skip
#: Frames of a second.
RATE = 12


@dataclass(frozen=True)
class Frame:
    """Particles at one time.

    Attributes:
        title: Of the picture.
        x: Positions [m], particles x 2.
        shape: Of the particles; see `Squares.show`.
        values: Quantity that colours them.
        sides: Ends of the sides of the border [m], sides x 2 x 2; None draws none.
    """

    title: str
    x: Array
    shape: Array | float
    values: Array
    sides: Array | None = None


class Film:
    """Particles in colours, with one range of colours and one view for all frames.

    Args:
        frames: At least one.
        scale: Colours.
        grid: Corners of the grid.
    """

    @style.used()
    def __init__(self, frames: Sequence[Frame], scale: Scale, grid: Corners) -> None:
        self.frames = frames
        lower, upper = view(np.concatenate([frame.x for frame in frames]), grid)
        self.figure = new_figure(*size_of(lower, upper))
        self.axes = self.figure.subplots()
        draw_frame(self.axes, lower, upper, grid)
        self.squares = Squares(self.axes, scale)
        self.squares.add_bar(self.axes)
        self._border = draw_border(self.axes, np.empty((0, 2, 2)))
        self.show(-1)
        lay_out(self.figure)
        self.figure.set_layout_engine("none")  # the same view in all frames

    def show(self, number: int) -> None:
        """Draw a frame."""
        frame = self.frames[number]
        self.squares.show(frame.x, frame.shape, frame.values)
        self._border.set_segments([] if frame.sides is None else list(frame.sides))
        self.axes.set_title(frame.title)

    def picture(self, path: Path) -> Path:
        """Write the last frame."""
        self.show(-1)
        save(self.figure, path)
        return path

    @style.used()
    def movie(self, path: Path, kind: Movie) -> Path:
        """Write all frames.

        Raises:
            OutputError: The file cannot be written.
        """
        images = []
        for number in range(len(self.frames)):
            self.show(number)
            canvas: Any = self.figure.canvas
            canvas.draw()
            images.append(np.array(canvas.buffer_rgba())[:, :, :3])
        with atomic_file(path) as part:
            (_gif if kind == "gif" else _mp4)(part, images)
        return path

    def animation(self) -> FuncAnimation:
        """All frames as an animation of matplotlib, which a notebook plays and `save` writes."""
        player: FuncAnimation = _player()(
            self.figure, self.show, len(self.frames), interval=1000 / RATE
        )
        return player


def _player() -> Any:
    from matplotlib.animation import FuncAnimation

    class Player(FuncAnimation):
        """Animation that a notebook plays without further settings."""

        def __init__(self, *arguments: Any, **options: Any) -> None:
            super().__init__(*arguments, **options)
            self._draw_was_started = True  # no warning about one that nobody plays

        def _repr_html_(self) -> str:
            with style.used():
                page = re.sub(r"<link[^>]*>", "", self.to_jshtml())
            for icon, sign in ICONS.items():
                page = page.replace(f'<i class="fa fa-{icon}"></i>', sign)
            return page

        @style.used()
        def save(self, filename: Any, writer: Any = None, *more: Any, **options: Any) -> None:
            """Write a movie, as `FuncAnimation.save`; a GIF without ffmpeg."""
            if writer is None and Path(filename).suffix == ".gif":
                writer = "pillow"
            super().save(filename, writer, *more, **options)

    return Player


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
