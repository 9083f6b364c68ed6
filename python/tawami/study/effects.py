"""Changes of a study that reduce the error or only cost time: five rows and two sentences."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from tawami.study.row import NOISE, Change, value_text
from tawami.study.table import Table

#: Rows of the table, and the largest number of rows of one kind.
ROWS, MOST = 5, 3
REDUCES, MIXED = "reduces the error", "reduces one error and increases another"
COSTS, NEUTRAL = "only costs time", "no effect"
KINDS = (REDUCES, MIXED, COSTS, NEUTRAL)


@dataclass(frozen=True)
class Effect:
    """Effect of a change of one knob.

    Attributes:
        change: The change towards accuracy, with the mean effect on all quantities.
        errors: Factor of the error of each quantity.
    """

    change: Change
    errors: Mapping[str, float]

    @property
    def kind(self) -> str:
        """Whether the change reduces errors, some of them, only costs time, or has no effect."""
        if min(self.errors.values()) * NOISE < 1:
            return MIXED if max(self.errors.values()) > NOISE else REDUCES
        return COSTS if self.change.cost > NOISE else NEUTRAL

    @property
    def text(self) -> str:
        """Knob and values."""
        change = self.change
        values = f"{value_text(change.before)} → {value_text(change.after)}"
        return f"{change.knob.replace('_', ' ')} {values}"


def effects(table: Table) -> list[Effect]:
    """The largest effect of each knob, of which at most five: first those that reduce the error."""
    strongest: dict[str, Effect] = {}
    for changes in zip(*(table.changes(q) for q in table.quantities), strict=True):
        one = changes[0]
        mean = float(np.exp(np.mean([np.log(c.error) for c in changes])))
        turned = Change(
            one.knob, one.before, one.after, mean, one.cost, one.pairs
        ).towards_accuracy()
        power = 1 if turned.before == one.before else -1
        pairs = zip(table.quantities, changes, strict=True)
        effect = Effect(turned, {q: c.error**power for q, c in pairs})
        known = strongest.get(one.knob)
        if known is None or _weight(effect) > _weight(known):
            strongest[one.knob] = effect
    ordered = sorted(strongest.values(), key=_weight, reverse=True)
    first = [e for kind in (REDUCES, COSTS) for e in [e for e in ordered if e.kind == kind][:MOST]]
    rest = [e for e in ordered if e not in first]
    chosen = [*first, *rest][:ROWS]
    return sorted(chosen, key=lambda effect: KINDS.index(effect.kind))


def _weight(effect: Effect) -> tuple[int, float]:
    """Order of effects: as KINDS; larger ones first."""
    kind, change = effect.kind, effect.change
    size = -np.log(change.error) if kind in (REDUCES, MIXED) else np.log(change.cost)
    return -KINDS.index(kind), float(size)


def as_markdown(table: Table) -> str:
    """The effects as a table of Markdown."""
    quantities = [q.replace("_", " ") for q in table.quantities]
    head = ["change", *(f"error of {q}" for q in quantities), "time", ""]
    lines = [f"| {' | '.join(head)} |", f"|{' --- |' * len(head)}"]
    for effect in effects(table):
        errors = (_factor(effect.errors[q]) for q in table.quantities)
        cells = [effect.text, *errors, _factor(effect.change.cost), effect.kind]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def sentences(table: Table) -> str:
    """Two sentences: changes that reduce the error, and those that only cost time."""
    found = effects(table)
    bought = _listed([e.text for e in found if e.kind == REDUCES])
    wasted = _listed([e.text for e in found if e.kind == COSTS])
    first = f"The error is reduced by {bought}." if bought else "No change reduces the error."
    second = (
        f"More time without more accuracy: {wasted}." if wasted else "No change only costs time."
    )
    failed = f" {len(table.failed)} of {len(table.rows)} runs failed." if table.failed else ""
    return f"{first} {second}{failed}"


def verdict(table: Table) -> str:
    """Tell which changes reduce the error and which only cost time: five rows and two sentences."""
    return f"{as_markdown(table)}\n\n{sentences(table)}"


def _listed(names: list[str]) -> str:
    return " and ".join(part for part in (", ".join(names[:-1]), *names[-1:]) if part)


def _factor(ratio: float) -> str:
    """A factor, rounded."""
    return f"x {ratio:.1g}" if ratio < 1 else f"x {ratio:.2g}" if ratio < 10 else f"x {ratio:.0f}"
