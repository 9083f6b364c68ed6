"""A run as an animation, for a notebook."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from tawami.base import checks
from tawami.base.line import Line
from tawami.base.optional import optional
from tawami.motion.observer import Motion
from tawami.picture import film
from tawami.picture.particles import scale_of
from tawami.quantities.presentation import checked_limits, corners_of, positions, shapes
from tawami.quantities.quantities import Given, body_arrays, of_scene
from tawami.quantities.scalars import pick

if TYPE_CHECKING:
    from matplotlib.animation import FuncAnimation

#: Frames of an animation, if no time between them is given.
USUAL = 48


class Camera:
    """Takes frames of a motion, at its start and at the first step at or after multiples of a time.

    Args:
        motion: The motion.
        quantity: Colours of the particles.
        every: Time between two frames [s].
        deformed: Factor on the displacements.
    """

    def __init__(self, motion: Motion, quantity: Given, every: float, deformed: float) -> None:
        self._motion, self._quantity = motion, quantity
        self._every, self._deformed = every, deformed
        self.name, self.unit, self.frames = "", "", list[film.Frame]()
        self._last = self._taken = -math.inf

    def __call__(self, time: float, *, last: bool = False) -> None:
        """Take a frame if it is due; a call for all ranks."""
        multiple = math.floor(time / self._every * (1 + 1e-12) + 1e-9)
        if multiple > self._last or (last and time > self._taken):
            self._last, self._taken = max(multiple, self._last), time
            scene, arrays = self._motion.scene, body_arrays(self._motion)
            self.name, self.unit, values = pick(self._quantity, arrays, of_scene(scene))
            moved, deformed = scene.form.strain.finite, self._deformed
            x = positions(arrays, moved=moved, deformed=deformed)
            shape = shapes(arrays, scene.grid.space, moved=moved, deformed=deformed)
            self.frames.append(film.Frame(f"$t$ = {time:.4g} s", x, shape, values))


def animate(
    run: Callable[[Callable[[Any], None]], Any],
    motion: Motion,
    times: tuple[float, float],
    quantity: Given,
    every: float | None,
    deformed: float,
    limits: tuple[float, float] | None,
    *,
    shown: bool | None,
) -> FuncAnimation:
    """Run a motion and make an animation of it; see `Dynamics.animate`.

    Args:
        run: Function that runs the motion and calls its argument after each step.
        motion: The motion.
        times: Start and end [s].
        quantity, every, deformed, limits: As in `Dynamics.animate`.
        shown: Whether a line shows the progress; by default at a terminal and in a notebook.
    """
    optional("matplotlib", "pictures need")  # before the run
    (start, end), limits = times, checked_limits(limits)
    usual = max((end - start) / USUAL, checks.LEAST)
    every = usual if every is None else checks.number("every", every, low=checks.LEAST)
    camera = Camera(motion, quantity, every, checks.number("deformed", deformed))
    camera(start)
    line = Line(shown if motion.scene.grid.comm.rank == 0 else False)

    def each(_: Any) -> None:
        now = motion.scene.time
        camera(now)
        line.show(f"{now:.6g} of {end:g} s", (now - start) / (end - start))

    try:
        run(each)
    finally:
        line.end()
    camera(motion.scene.time, last=True)
    scale = scale_of(camera.name, camera.unit, [frame.values for frame in camera.frames], limits)
    return film.Film(camera.frames, scale, corners_of(motion.scene.grid)).animation()
