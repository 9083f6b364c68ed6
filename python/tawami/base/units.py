"""Units of numbers in files, and their factors to the units of tawami."""

from __future__ import annotations

#: Unit of tawami -> units that are converted to it, with their factors. Cases matter: mPa is not MPa.
UNITS: dict[str, dict[str, float]] = {
    "Pa": {
        "Pa": 1.0, "N/m2": 1.0, "hPa": 1e2, "kPa": 1e3, "kN/m2": 1e3, "MPa": 1e6, "MN/m2": 1e6,
        "N/mm2": 1e6, "GPa": 1e9,
    },
    "m": {"m": 1.0, "km": 1e3, "dm": 1e-1, "cm": 1e-2, "mm": 1e-3, "um": 1e-6},
    "m/s": {"m/s": 1.0, "km/s": 1e3, "cm/s": 1e-2, "mm/s": 1e-3},
    "m2 per m": {"m2 per m": 1.0, "m2": 1.0, "cm2": 1e-4, "mm2": 1e-6},
    "m3": {"m3": 1.0, "dm3": 1e-3, "cm3": 1e-6, "mm3": 1e-9},
    "-": {"-": 1.0, "%": 1e-2, "1": 1.0},
}  # fmt: skip
#: Other ways of writing a unit.
SPELLINGS = {"²": "2", "^": "", "**": "", "µ": "u", "μ": "u"}


def known(text: str) -> bool:
    """Whether this is a unit that is converted, without brackets: a number is part of the name there."""
    return not text.strip().isdigit() and any(_plain(text) in units for units in UNITS.values())


def factor(text: str, unit: str) -> float:
    """Factor from a unit in a file to that of tawami; 1 if the file names none.

    Raises:
        ValueError: Not a unit of this kind.
    """
    units = UNITS[unit]
    if not text:
        return 1.0
    if _plain(text) not in units:
        raise ValueError(f"the unit [{text}]: expected one of {', '.join(units)}")
    return units[_plain(text)]


def _plain(text: str) -> str:
    text = " ".join(text.split())
    for spelling, usual in SPELLINGS.items():
        text = text.replace(spelling, usual)
    return text
