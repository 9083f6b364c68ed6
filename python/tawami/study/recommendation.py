"""The cheapest setting of a study within a tolerance."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from tawami.base import checks
from tawami.base.errors import InputError
from tawami.study.row import Row
from tawami.study.study import Study
from tawami.study.table import Table


def recommend(
    study: Study | Table | str | Path,
    tolerance: float | Mapping[str, float],
    *,
    cost: str = "wall_s",
) -> Row:
    """The cheapest measured setting within a tolerance.

    Ask for several quantities: a single one may be right because two errors cancel.

    Args:
        study: A study that has been run, its table, or the CSV file of one.
        tolerance: Largest error of every quantity, or of each by its name.
        cost: 'wall_s', 'cpu_s' or 'peak_MB'.

    Returns:
        The run; its knobs are the setting.

    Raises:
        InputError: No setting is within the tolerance; the message names the nearest one.
    """
    if isinstance(study, str | Path):
        table = Table.read(study)
    else:
        expected = "a study, its table, or the path of its CSV file"
        checks.instance("recommend: study", study, Study | Table, expected)
        table = study.table() if isinstance(study, Study) else study
    if not isinstance(tolerance, Mapping):
        tolerance = dict.fromkeys(table.quantities, tolerance)
    limits = {q: checks.number(f"tolerance of {q}", t, low=0.0) for q, t in tolerance.items()}
    if not limits:
        raise InputError("tolerance = {}: expected a number, or one for each of some quantities")
    for quantity in limits:
        table.check(quantity, cost)
    rows = table.of(table.series[0])

    def excess(row: Row) -> float:
        return max(row.errors[q] / max(limit, 1e-300) for q, limit in limits.items())

    within = [row for row in rows if excess(row) <= 1]
    if within:
        return min(within, key=lambda row: row.costs[cost])
    asked = ", ".join(f"{quantity} {limit:g}" for quantity, limit in limits.items())
    nearest = f": the nearest is {min(rows, key=excess)}" if rows else ": every run failed"
    raise InputError(
        f"no measured setting of study '{table.name}' is within {asked}{nearest}. Use a larger "
        "tolerance, or add finer settings to the study"
    )
