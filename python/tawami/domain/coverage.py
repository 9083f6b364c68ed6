"""Whether the particles of a body integrate over the cells that they fill.

A cell is filled where its particles have its area. There they must not crowd on one side or at the
border, and must not differ from cell to cell. Otherwise sums over them are not integrals, and stress can
be wrong by any amount (`python -m cases.extremes --only particles`).
"""

from __future__ import annotations

import numpy as np

from tawami.base.arrays import Array
from tawami.base.errors import QuadratureWarning
from tawami.base.warn import warn
from tawami.domain.domain import Domain

#: Part of a cell by which one that counts as filled may miss its area or go beyond it.
FILLED = 0.05
#: Centroid off the centre [cells]; a lattice of 2 x 2 that is moved over the grid comes to 1/4.
OFF_CENTRE = 0.25 + 1e-6
#: Mean square of the distance from the centre along an axis [cells^2]; 1/12 is exact, that lattice comes
#: to 1/8.
SPREAD = 0.15
#: Difference of the centroids of two neighbours [cells]; 0 for any lattice.
UNLIKE = 0.2


def warn_of_faults(domain: Domain) -> None:
    """Warn of the cell that the particles integrate worst, if any is bad; a call for all ranks."""
    grid = domain.model.grid
    faults = grid.comm.allgather(_fault(*_moments(domain), *grid.window.first))
    found = sorted(fault for fault in faults if fault is not None)
    if not found or grid.comm.rank:
        return
    *_, j, i, what = found[0]
    warn(
        f"the particles integrate badly: cell ({i}, {j}) {what}. The stress may be wrong; expected "
        "particles spread over the cells that they fill, as box(...) and polygon(...) place them",
        QuadratureWarning,
    )


def _moments(domain: Domain) -> tuple[Array, Array, Array]:
    """Area (ny x nx) [cells], first and second moments about the centre (ny x nx x 2) of the particles
    of each cell, divided by the area; NaN in cells without any.
    """
    location, grid = domain.location, domain.model.grid
    off = np.asarray(location.xi) - 0.5
    columns = np.column_stack([np.ones(len(off)), off, off**2])
    columns *= domain.areas[:, None]
    sums = domain.responses.cell_sums(columns / grid.space.measure(grid.h))
    sums = sums.reshape(*grid.window.cells[::-1], columns.shape[1])
    area = sums[..., 0]
    with np.errstate(invalid="ignore", divide="ignore"):
        return area, sums[..., 1:3] / area[..., None], sums[..., 3:] / area[..., None]


def _fault(
    area: Array, first: Array, second: Array, x: int, y: int
) -> tuple[int, float, int, int, str] | None:
    """The worst fault: its kind, minus its size, a cell (j, i) of the grid, and its description.

    Args:
        area, first, second: Moments of the particles of each cell of the window.
        x, y: First cell of the window.
    """
    filled = np.abs(area - 1) <= FILLED

    def worst(kind: int, values: Array) -> tuple[tuple[int, float, int, int], float]:
        j, i = np.unravel_index(int(values.argmax()), values.shape)
        most = float(values[j, i])
        return (kind, -most, int(j) + y, int(i) + x), most

    place, most = worst(0, area)
    if most > 1 + FILLED:
        return *place, f"holds {most:.3g} times its area"
    place, most = worst(1, np.where(filled, np.abs(first).max(axis=2), 0.0))
    if most > OFF_CENTRE:
        return (
            *place,
            f"has its particles on one side, their centroid {most:.2g} h off the centre",
        )
    place, most = worst(2, np.where(filled, second.max(axis=2), 0.0))
    if most > SPREAD:
        return *place, f"has its particles at its border, {most**0.5:.2g} h (rms) off the centre"
    for axis in (0, 1):
        both = np.delete(filled, 0, axis) & np.delete(filled, -1, axis)
        jump = np.abs(np.diff(first, axis=axis)).max(axis=2)
        if not jump.size:
            continue
        place, most = worst(3, np.where(both, jump, 0.0))
        if most > UNLIKE:
            text = f"and its neighbour have their particles in places that differ by {most:.2g} h"
            return *place, text
    return None
