"""Supports that leave an edge of the grid: their points take its tractions over."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager

import numpy as np

from tawami.base.arrays import Array
from tawami.conditions.support import Support
from tawami.domain.domain import Domain
from tawami.domain.moving_points import MovingPoints
from tawami.field.border import BorderInCells
from tawami.grid.grid import Edge

#: A support, an edge of the grid that it is on, and the positions of its points there [m].
OnEdge = tuple[Support, Edge, Array]


def on_edges(supports: Iterable[Support]) -> list[OnEdge]:
    """Supports on edges of the grid where they are."""
    return [
        (support, edge, support.place.x[support.whole[edge]])
        for support in supports
        if isinstance(support.place, MovingPoints) and not support.is_field
        for edge in support.edges
    ]


@contextmanager
def taken_over(domain: Domain, supports: Iterable[Support], forces: Array) -> Iterator[None]:
    """A block that moves the border. Points of supports that leave their edge get its tractions.

    These are the lumped projection of the forces on the functions of the edge, with the same resultant.

    Args:
        domain: The particles at the start of the step.
        supports: The supports.
        forces: Of supports on the body in this step, functions x dim [N per metre depth].
    """
    before = on_edges(supports)
    yield
    grid = domain.model.grid
    for support, edge, x in before:
        if edge in support.edges or not isinstance(support.place, MovingPoints):
            continue
        mask = support.whole[edge]
        axis, sign = support.along_edge(edge, grid)
        across, end = grid.edge(edge)
        normal = np.zeros_like(x)
        normal[:, across] = 1.0 if end else -1.0
        cells = BorderInCells(grid, domain.active, x, normal, f"{support}")
        layout, on_axis = domain.layout, np.ascontiguousarray(forces[:, axis, None])
        sums = cells.sums(layout.functions, layout.basis, support.place.weight[mask, None])
        tractions = np.divide(on_axis, sums, out=np.zeros_like(sums), where=sums > 0)
        support.held[mask] = -sign * cells.at(layout.basis, tractions)[:, 0]
