"""The one style of figures: fonts, colours that are safe for colour blindness, units in brackets.

Lines have the colours of Okabe and Ito (https://jfly.uni-koeln.de/color). Magnitudes have a map of
growing lightness, and values of both signs a map from blue through white to red.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from tawami.base.optional import optional

BLUE, VERMILION, GREEN, ORANGE = "#0072B2", "#D55E00", "#009E73", "#E69F00"
PURPLE, SKY, BLACK, GRAY = "#CC79A7", "#56B4E9", "#000000", "#7F7F7F"
#: Colours of lines, in their order.
LINES = (BLUE, VERMILION, GREEN, ORANGE, PURPLE, SKY, BLACK, GRAY)
#: Colour maps of magnitudes and of values of both signs, and what is drawn behind the latter.
MAGNITUDE, SIGNED, BEHIND = "viridis", "RdBu_r", "0.85"
#: Map of magnitudes that are 0 in most of a picture, from light to dark.
FROM_ZERO = "magma_r"
#: Settings of matplotlib.
PARAMETERS = {
    "font.family": "DejaVu Sans",
    "font.size": 9,
    "axes.titlesize": 10,
    "axes.labelsize": 9,
    "axes.prop_cycle": f"cycler('color', {list(LINES)})",
    "axes.axisbelow": True,
    "figure.titlesize": 12,
    "legend.fontsize": 8,
    "lines.linewidth": 1.4,
    "lines.markersize": 4,
    "grid.alpha": 0.3,
    "image.cmap": MAGNITUDE,
}
PREFIXES = (("G", 1e9), ("M", 1e6), ("k", 1e3))


@contextmanager
def used() -> Iterator[None]:
    """Draw in this style within the block; also a decorator.

    Raises:
        MissingDependencyError: matplotlib is not installed.
    """
    settings = optional("matplotlib", "pictures need").rcParams
    # these alone: rc_context would undo what the first figure in a notebook makes of pyplot
    before = {name: settings[name] for name in PARAMETERS}
    try:
        settings.update(PARAMETERS)
        yield
    finally:
        settings.update(before)


def labelled(name: str, unit: str) -> str:
    """Name and unit of an axis or a colour bar."""
    return f"{name} [{unit}]"


def scaled(unit: str, largest: float) -> tuple[str, float]:
    """kPa, MPa or GPa instead of Pa for large values, and the factor."""
    for prefix, factor in PREFIXES if unit == "Pa" else ():
        if largest >= factor:
            return f"{prefix}{unit}", factor
    return unit, 1.0
