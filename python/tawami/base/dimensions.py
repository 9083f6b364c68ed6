"""Units in text, as a form declares them: "Pa", "m2", "W/(m K)", "kg m-1 s-2", "-"."""

from __future__ import annotations

import re
from collections.abc import Mapping
from types import MappingProxyType

#: Exponents of base units: those of the SI, and any other symbol, which is a base unit of its own.
Dimension = Mapping[str, float]
#: Coherent derived units in base units.
DERIVED: Mapping[str, Dimension] = {
    "N": {"kg": 1, "m": 1, "s": -2}, "Pa": {"kg": 1, "m": -1, "s": -2},
    "J": {"kg": 1, "m": 2, "s": -2}, "W": {"kg": 1, "m": 2, "s": -3}, "Hz": {"s": -1},
    "rad": {}, "-": {}, "1": {},
}  # fmt: skip
TOKEN = re.compile(r"\s*(?:(\*\*|[()/*·])|([A-Za-zµΩ°%]+|-(?!\d)|1)(?:\^|\*\*)?(-?\d+(?:\.\d+)?)?)")
SUPERSCRIPTS = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-")


def dimension(text: str) -> Dimension:
    """Exponents of base units of a unit.

    A symbol that is no coherent unit of the SI (kPa, bar, %) counts as a base unit of its own: it then
    contradicts the coherent one.

    Args:
        text: Products by spaces, * or ·; quotients by /; exponents as m2, m^2, m**2 or m².

    Raises:
        ValueError: The text is no unit.
    """
    tokens, place = list[tuple[str, str, str]](), 0
    text = text.translate(SUPERSCRIPTS).strip()
    while place < len(text):
        match = TOKEN.match(text, place)
        if match is None:
            raise ValueError(f"'{text}' is no unit")
        tokens.append((match[1] or "", match[2] or "", match[3] or "1"))
        place = match.end()
    found, rest = _product(tokens)
    if rest or not tokens:
        raise ValueError(f"'{text}' is no unit")
    return MappingProxyType({name: power for name, power in found.items() if power})


def _product(
    tokens: list[tuple[str, str, str]],
) -> tuple[dict[str, float], list[tuple[str, str, str]]]:
    """The product at the beginning of tokens, and the tokens after it."""
    total, sign = dict[str, float](), 1.0
    while tokens and tokens[0][0] != ")":
        (mark, name, power), *tokens = tokens
        if mark == "/":
            sign = -1.0
            continue
        if mark in ("*", "·"):
            continue
        if mark == "(":
            factor, tokens = _product(tokens)
            if not tokens:
                return total, [("(", "", "")]
            tokens = tokens[1:]
        else:
            factor = {n: e * float(power) for n, e in DERIVED.get(name, {name: 1}).items()}
        for base, exponent in factor.items():
            total[base] = total.get(base, 0.0) + sign * exponent
        sign = 1.0
    return total, tokens


def text_of(dimension: Dimension) -> str:
    """A unit in base units, as "kg m-1 s-2"."""
    named = [
        name if power == 1 else f"{name}{power:g}"
        for name, power in sorted(dimension.items())
        if abs(power) > 1e-9
    ]
    return " ".join(named) or "-"


def size(dimension: Dimension, scales: Mapping[str, float]) -> float:
    """Size of a unit where base units have these sizes, 1 for others."""
    product = 1.0
    for name, power in dimension.items():
        product *= scales.get(name, 1.0) ** power
    return product
