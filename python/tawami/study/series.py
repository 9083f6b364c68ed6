"""Series of a study: a function and the settings that it is run with."""

from __future__ import annotations

import functools
import itertools
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tawami.base import checks
from tawami.base.errors import InputError
from tawami.study import process

Knobs = Mapping[str, Any]
Grid = Mapping[str, Sequence[Any]]
#: Label, setting and fingerprint.
Key = tuple[str, str, str]


@dataclass(frozen=True)
class Series:
    """A function and the settings of its knobs, for instance finite elements for comparison.

    Args:
        label: Its name in the picture.
        run: Function at the top level of a file: takes knobs by name and returns a mapping from names of
            quantities to numbers or lists of numbers. Newton iterations, steps and unknowns are counted;
            'newton_iterations', 'steps' or 'unknowns' among the quantities count instead.
        knobs: Values of each knob, of which all combinations are run; or a list of such mappings.
    """

    label: str
    run: process.Run
    knobs: Grid | Sequence[Grid]

    def __post_init__(self) -> None:
        if not isinstance(self.label, str):
            raise InputError(f"label = {checks.shown(self.label)}: expected the name of a series")
        grids = self.knobs if is_list(self.knobs) else [self.knobs]
        named = (isinstance(g, Mapping) and all(isinstance(n, str) for n in g) for g in grids)
        if len(grids) == 0 or not all(named):
            raise InputError(
                f"series '{self.label}': knobs = {checks.shown(self.knobs)}: expected a mapping from "
                "names of knobs to their values, or a list of such"
            )

    @functools.cached_property
    def fingerprint(self) -> str:
        """Hash of all that a measurement depends on besides the knobs."""
        return process.fingerprint(self.run)

    def key(self, setting: Knobs) -> Key:
        """Key by which a stored run of a setting is found."""
        return self.label, setting_text(setting), self.fingerprint

    def settings(self) -> Iterator[dict[str, Any]]:
        """Every setting once, in the order in which knobs and values were given."""
        grids = [self.knobs] if isinstance(self.knobs, Mapping) else self.knobs
        known = set()
        for grid in grids:
            for values in itertools.product(*(knob_values(*knob) for knob in grid.items())):
                setting = dict(zip(grid, values, strict=True))
                if setting_text(setting) not in known:
                    known.add(setting_text(setting))
                    yield setting


def knob_values(name: str, values: Any) -> Sequence[Any]:
    """Values of a knob, checked."""
    if not is_list(values) or len(values) == 0:
        raise InputError(f"knob '{name}' = {checks.shown(values)}: expected a list of its values")
    if not all(isinstance(v, str | bool | int | float | None) for v in values):
        raise InputError(
            f"knob '{name}' = {checks.shown(values)}: expected numbers, names, booleans or None"
        )
    return list(values)


def is_list(value: Any) -> bool:
    """Whether a value is a list, a tuple or an array."""
    if isinstance(value, np.ndarray):
        return value.ndim > 0
    return isinstance(value, Sequence) and not isinstance(value, checks.TEXT)


def setting_text(setting: Knobs) -> str:
    """A setting as text; equal settings have equal texts."""
    return json.dumps(setting, sort_keys=True)
