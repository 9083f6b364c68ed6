"""Cook's membrane. This module does not depend on a method.

    y                 _ (48, 60)    plane strain, small strain, one static step
    |         _ . - ' |
    44  _ - '         | P = 1       E = 70, nu = 0.499 or 0.4999; units are arbitrary, the depth is 1
    |               . ' (48, 44)    held on the left; P upward, uniform over the right end
    |           . '
    |       . '                     result: u_y at the middle of the right end, (48, 52)
    |   . '
    +--------------------- x

The membrane combines bending and shear, and its sides are not aligned with the grid. The stress is
singular at (0, 44), where the held side meets a free one. On uniform meshes the deflection therefore
converges like h^1.1 with any method, finite elements included, and the order of a method does not show.

Source: Cook, J. Struct. Div. ASCE 100 (1974) 1851. Nearly incompressible, it is a common test for
locking. There is no closed form.
"""

from __future__ import annotations

from dataclasses import dataclass

CORNERS = ((0.0, 0.0), (48.0, 44.0), (48.0, 60.0), (0.0, 44.0))
LENGTH, HEIGHT = 48.0, 60.0  # of the bounding box
CLAMPED = (0.0, 44.0)  # range of y at the left end
LOADED = (44.0, 60.0)  # range of y at the right end
MIDDLE = (48.0, 52.0)  # where the deflection is measured

E = 70.0  # Young's modulus
P = 1.0  # load
SHEAR = P / (LOADED[1] - LOADED[0])  # traction on the right end

#: Limit of u_y by Poisson's ratio, from finite elements (`cases.verification.cook.fem`), within 1e-6.
REFERENCE = {0.499: 0.264752, 0.4999: 0.264456}

COLUMNS = (
    "method", "body", "nu", "h", "deflection", "error_percent", "particles", "unknowns", "condition",
)  # fmt: skip


@dataclass(frozen=True)
class Row:
    """One line of the table. None stands for an empty cell."""

    method: str
    body: str | None
    nu: float
    h: float
    deflection: float
    particles: int | None
    unknowns: int
    condition: float | None

    @property
    def error_percent(self) -> float:
        """Error of the deflection [%]."""
        return 100 * (self.deflection / REFERENCE[self.nu] - 1)
