"""The list of all computations: every method, support and mesh."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from cases.verification.cantilever import fem, mpm
from cases.verification.cantilever.beam import SUPPORTS, Row

CELLS = (2, 4, 8, 16, 32)
ALPHAS = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5)
MPM_METHODS = (("u", None), ("u_bbar", None), *(("u_epsv", alpha) for alpha in ALPHAS))


@dataclass(frozen=True)
class Run:
    """One computation; `alpha` is None for a method without stabilisation."""

    method: str
    support: str
    n: int
    alpha: float | None = None

    def __call__(self) -> Row:
        """Compute it."""
        if self.method in fem.METHODS:
            return fem.solve(self.method, self.support, self.n)
        return mpm.solve(self.method, self.support, self.n, self.alpha)[0]


def runs(cells: Sequence[int] = CELLS) -> Iterator[Run]:
    """All computations of the comparison."""
    for support in SUPPORTS:
        for method, alpha in MPM_METHODS:
            yield from (Run(method, support, n, alpha) for n in cells)
        for method in fem.METHODS:
            yield from (Run(method, support, n) for n in cells)
