"""Differential operators that a residual takes from UFL instead of asking for them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import ufl

from tawami.form.named import first_lines

#: Operators that depend on the geometry, and the name of a residual that stands for them.
INSTEAD = {"grad": "grad", "nabla_grad": "grad", "div": "div", "nabla_div": "div", "Identity": "I"}


def from_ufl(residual: Callable[..., Any]) -> list[tuple[str, str, int]]:
    """Operators of UFL in a residual and in the functions that it calls.

    Returns:
        Name, the name to ask for instead, and the first line.
    """
    found = first_lines(residual, {operator: getattr(ufl, operator) for operator in INSTEAD})
    return [(operator, INSTEAD[operator], line) for operator, line in found.items()]
