"""Picture of a study: error over cost in logarithmic axes, fronts, numbered knees."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tawami.picture import style
from tawami.picture.figure import new_figure, save
from tawami.study.peers import Peer, peer_front
from tawami.study.row import Row, text_of
from tawami.study.table import Table

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LABELS = {
    "wall_s": "wall time [s]",
    "cpu_s": "processor time [s]",
    "peak_MB": "peak memory [MB]",
    "newton_iterations": "Newton iterations [-]",
    "steps": "steps [-]",
    "unknowns": "unknowns [-]",
}
MARKERS = "os^Dvp*X"


@style.used()
def picture(
    table: Table,
    path: str | Path,
    *,
    colour: str | None = None,
    cost: str = "wall_s",
    quantities: Sequence[str] | None = None,
    title: str | None = None,
    marks: Mapping[str, Mapping[str, Any]] | None = None,
    peers: Sequence[Peer] = (),
) -> None:
    """Draw a study: a panel for each quantity, a marker for each series, the fronts as lines.

    Args:
        table: The runs.
        path: PNG to write.
        colour: Knob whose values have colours.
        cost: Quantity of the abscissa: 'wall_s', 'cpu_s', 'peak_MB', ...
        quantities: Quantities to draw; by default all that have errors.
        title: Above the panels; the name of the study by default.
        marks: Name -> setting that is marked; `...` as a value stands for any.
        peers: Runs of other codes, in pictures over wall time.

    Raises:
        MissingDependencyError: matplotlib is not installed.
        OutputError: The file cannot be written.
    """
    quantities = list(quantities or table.quantities)
    columns = min(len(quantities), 2)
    rows = -(-len(quantities) // columns)
    figure = new_figure(7.5 * columns, 6.5 * rows + 1)
    panels = list(figure.subplots(rows, columns, squeeze=False).ravel())
    for unused in panels[len(quantities) :]:
        unused.remove()
    panels = panels[: len(quantities)]
    values = list(
        dict.fromkeys(row.knobs.get(colour or "", "") for row in table.of(table.series[0]))
    )
    colours = {value: style.LINES[k % len(style.LINES)] for k, value in enumerate(values)}
    for axes, quantity in zip(panels, quantities, strict=True):
        _panel(axes, table, quantity, cost, colour, colours)
        _mark(axes, table, quantity, cost, marks or {})
        if cost == "wall_s":
            _add_peers(axes, quantity, peers)
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4)
    figure.suptitle(title or table.name.replace("_", " "))
    save(figure, path, dpi=150)


def _panel(
    axes: Axes, table: Table, quantity: str, cost: str, colour: str | None, colours: dict[Any, str]
) -> None:
    least = min((r.errors[quantity] for r in table.of() if r.errors[quantity] > 0), default=1e-16)

    def place(rows: Sequence[Row]) -> tuple[list[float], list[float]]:
        """Coordinates of runs; a run without error is drawn at the smallest error of the others."""
        return [r.costs[cost] for r in rows], [max(r.errors[quantity], least) for r in rows]

    own = table.series[0]
    for number, label in enumerate(table.series):
        marker = MARKERS[number % len(MARKERS)]
        if label == own and colour is not None:
            for value, shade in colours.items():
                mine = [row for row in table.of(label) if row.knobs.get(colour, "") == value]
                axes.plot(*place(mine), marker, color=shade, markersize=5, alpha=0.7,
                          label=f"{label}: {colour} {value}" if value != "" else label)  # fmt: skip
        else:
            axes.plot(*place(table.of(label)), marker, color="black", markersize=5, fillstyle="none",
                      label=label)  # fmt: skip
        dash = "-" if label == own else "--"
        front = table.front(quantity, cost=cost, series=label)
        axes.step(*place(front), dash, where="post", color="black", linewidth=1,
                  label=f"front, {label}")  # fmt: skip
    knees = table.knees(quantity, cost=cost, series=own)
    best = table.knee(quantity, cost=cost, series=own)
    lines = []
    for number, row in enumerate(knees, start=1):
        ((x,), (y,)) = place([row])
        axes.annotate(str(number), (x, y), textcoords="offset points", xytext=(-9, -13),
                      fontsize=10, fontweight="bold")  # fmt: skip
        axes.plot([x], [y], "o", markersize=11, fillstyle="none", color=style.BLACK,
                  markeredgewidth=2.2 if row is best else 1.0,
                  label="corners of the front" if number == 1 else None)  # fmt: skip
        lines.append(f"{number}{' (knee)' if row is best else ''}: {text_of(row.knobs)}")
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlabel(LABELS[cost] + "\n\n" + "\n".join(lines), loc="left")
    axes.set_ylabel(f"error of {quantity} [-]")
    axes.grid(which="both")


def _mark(
    axes: Axes, table: Table, quantity: str, cost: str, marks: Mapping[str, Mapping[str, Any]]
) -> None:
    """Draw lines through the runs of marked settings."""
    shades = (style.PURPLE, style.SKY, style.GRAY)  # those of values of a knob begin with others
    for (name, setting), shade in zip(marks.items(), shades, strict=False):
        rows = sorted(table.matching(setting), key=lambda row: row.costs[cost])
        axes.plot([r.costs[cost] for r in rows], [r.errors[quantity] for r in rows], "s-", color=shade,
                  markersize=9, fillstyle="none", markeredgewidth=2.2, linewidth=2.2,
                  label=name)  # fmt: skip


def _add_peers(axes: Axes, quantity: str, peers: Sequence[Peer]) -> None:
    """Draw runs of other codes and their fronts; an error without a time is a horizontal line."""
    shown = [peer for peer in peers if quantity in peer.errors]
    for number, label in enumerate(dict.fromkeys(peer.label for peer in shown)):
        mine = [peer for peer in shown if peer.label == label]
        timed = [peer for peer in mine if np.isfinite(peer.wall_s)]
        for peer in mine:
            if peer not in timed:
                axes.axhline(peer.errors[quantity], color=style.GRAY, linestyle=":", label=label)
        axes.plot([p.wall_s for p in timed], [p.errors[quantity] for p in timed],
                  MARKERS[-1 - number % len(MARKERS)], color=style.GRAY, markersize=8,
                  label=label if timed else None)  # fmt: skip
        best = peer_front(timed, quantity)
        axes.step([p.wall_s for p in best], [p.errors[quantity] for p in best], ":", where="post",
                  color=style.GRAY, linewidth=1.5,
                  label=f"front, {label}" if best else None)  # fmt: skip
