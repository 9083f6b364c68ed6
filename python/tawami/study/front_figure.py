"""Picture of a trade: error over time in logarithmic axes, with uncertainties."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from tawami.picture import style
from tawami.picture.figure import new_figure, save
from tawami.study.front import Run, Trade
from tawami.study.row import text_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Errors below this part of the smallest bound are drawn at it.
DEEPEST = 0.1


@style.used()
def picture(trade: Trade, path: str | Path) -> None:
    """Draw the errors of all runs over wall time, the front, the default and the recommended setting.

    Without a limit the values are drawn instead of errors, over those of the default.

    Args:
        trade: The runs.
        path: PNG to write.

    Raises:
        MissingDependencyError: matplotlib is not installed.
        OutputError: The file cannot be written.
    """
    figure = new_figure(7.0, 5.0)
    axes = figure.subplots()
    if trade.converges:
        _errors(axes, trade)
    else:
        _values(axes, trade)
    axes.set_xscale("log")
    axes.set_xlabel("wall time [s]")
    axes.grid(which="both")
    axes.legend(loc="best")
    names = ", ".join(trade.estimates)
    axes.set_title(f"{trade.name}: {names}" + ("" if trade.converges else ", no limit"))
    save(figure, path, dpi=150)


def _errors(axes: Axes, trade: Trade) -> None:
    runs = trade.succeeded
    least = DEEPEST * min((run.bound for run in runs if run.bound > 0), default=1.0)

    def place(some: Sequence[Run]) -> tuple[list[float], list[float]]:
        return [run.wall_s for run in some], [max(run.bound, least) for run in some]

    times, bounds = place(runs)
    middle = [max(run.error, least) for run in runs]
    low = [
        max(min(run.errors[q] - run.uncertainties[q] for q in run.errors), least) for run in runs
    ]
    below = [max(m - a, 0) for m, a in zip(middle, low, strict=True)]
    above = [max(b - m, 0) for m, b in zip(middle, bounds, strict=True)]
    axes.errorbar(times, middle, [below, above], fmt="o", color=style.GRAY, elinewidth=0.8,
                  label="run, with the uncertainty of its error")  # fmt: skip
    axes.step(*place(trade.front()), where="post", color=style.BLUE, label="front of the bounds")
    for mark, run in trade.chosen():
        for name, marker, colour in (
            ("default", "s", style.ORANGE),
            ("recommended", "o", style.VERMILION),
        ):
            if name in mark:
                axes.plot(*place([run]), marker, markersize=12, fillstyle="none", color=colour,
                          markeredgewidth=2, label=f"{name}: {text_of(run.knobs)}")  # fmt: skip
    axes.axhline(trade.tolerance, color=style.BLACK, linewidth=0.8, linestyle=":",
                 label=f"tolerance {100 * trade.tolerance:.2g} %")  # fmt: skip
    axes.set_yscale("log")
    axes.set_ylabel("relative error [-]")


def _values(axes: Axes, trade: Trade) -> None:
    runs = trade.succeeded
    unit = trade.default or runs[-1]
    for quantity in trade.estimates:
        scale = unit.values[quantity] or 1.0
        values = [run.values[quantity] / scale for run in runs]
        axes.plot([run.wall_s for run in runs], values, "o", label=quantity)
    axes.set_ylabel(f"value over that of {text_of(unit.knobs)}")
