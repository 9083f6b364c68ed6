"""Cook's membrane. Nothing here knows how it is solved.

    y                 _ (48, 60)    plane strain, small strain, one static step
    |         _ . - ' |
    44  _ - '         | P = 1       E = 70, nu = 0.499 or 0.4999; units are arbitrary, the depth is 1
    |               . ' (48, 44)    held on the left; P upward, uniform over the right end
    |           . '
    |       . '                     asked for: u_y at the middle of the right end, (48, 52)
    |   . '
    +--------------------- x

Bending and shear at once, in a body whose sides are not those of the squares. Where the held side
meets the free one, at (0, 44), stress is singular, so that on uniform meshes the deflection converges
like h^1.1 with any method, finite elements included; no method's own order shows.

Source: Cook, J. Struct. Div. ASCE 100 (1974) 1851; nearly incompressible it is a usual test for
locking. No closed form.
"""

from __future__ import annotations

from dataclasses import dataclass

CORNERS = ((0.0, 0.0), (48.0, 44.0), (48.0, 60.0), (0.0, 44.0))
LENGTH, HEIGHT = 48.0, 60.0  # of the smallest box around it
CLAMPED = (0.0, 44.0)  # range of y on the left end
LOADED = (44.0, 60.0)  # range of y on the right end
MIDDLE = (48.0, 52.0)  # where the deflection is asked for

E = 70.0  # Young's modulus
P = 1.0  # load
SHEAR = P / (LOADED[1] - LOADED[0])  # traction on the right end

#: Poisson's ratio: u_y that finite elements converge to (`cases.verification.cook.fem`), within 1e-6.
REFERENCE = {0.499: 0.264752, 0.4999: 0.264456}

COLUMNS = (
    "method", "body", "nu", "h", "deflection", "error_percent", "particles", "unknowns", "condition",
)  # fmt: skip


@dataclass(frozen=True)
class Row:
    """One line of the table; None is a blank."""

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
        """Of the deflection."""
        return 100 * (self.deflection / REFERENCE[self.nu] - 1)
