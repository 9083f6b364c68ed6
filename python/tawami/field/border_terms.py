"""Sums of a form over the border of a body, `sum_b`: kernels at the points of the border.

Every rank holds all points and evaluates those in its own cells.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from tawami import _rust
from tawami.base import ranks
from tawami.base.arrays import Array, Indices, Mask
from tawami.base.errors import InputError
from tawami.base.text import meant, position, quoted
from tawami.border.points import BorderPoints
from tawami.field.attachment import Attachment
from tawami.field.border import BorderInCells
from tawami.field.kernels import KernelsAtPoints
from tawami.form.quantities import ParticleScalar

#: Distance between the cells in the search for the nearest particle of a cell [cells].
APART = 100.0


class BorderTerms:
    """The sums of a form over the border.

    Making one is a collective call.

    Args:
        attachment: The form and the active cells.
        points: Points of the border, the same on every rank.
        particles: Numbers of this rank's particles by name: K, mu, rho, data, old fields.
        carried: Numbers of the points by name, which replace those of the nearest particle. 'old u[0]'
            is the x component of the displacement since the start of the scene.

    Attributes:
        cells: The points in the cells of the grid.

    Raises:
        InputError: The border lacks a part that the form names, or a number that it reads.
        SupportError: The border is away from all particles.
    """

    def __init__(
        self,
        attachment: Attachment,
        points: BorderPoints,
        particles: Mapping[str, Array],
        carried: Mapping[str, Array],
    ) -> None:
        self._form, self._comm = attachment.compiled.form, attachment.grid.comm
        self._read = attachment.compiled.border_data
        grid, terms = attachment.grid, attachment.compiled.border
        parts = [parts_of(points, term.on, self._form.name) for term in terms]
        self.cells = BorderInCells(grid, attachment.active, points.x, points.normal)
        cells = self.cells
        mine = np.isin(cells.here, attachment.location.active)
        xi = np.asarray(cells.location.xi)
        self._points, self._particles, self._carried = points, particles, carried
        self._nearest = _nearest(attachment.location, cells.here, xi, mine)
        length = points.length * grid.space.thickness(points.x)
        #: Kernels of each sum, its points and their data.
        self._sums: list[tuple[KernelsAtPoints, Indices, Array]] = []
        for term, part in zip(terms, parts, strict=True):
            chosen = np.flatnonzero(mine & part)
            location = grid.window.rust.place(cells.here[chosen].astype(np.uint32), xi[chosen])
            kernels = KernelsAtPoints(
                attachment, location, length[chosen], term.residual, term.tangent
            )
            self._sums.append((kernels, chosen, np.zeros((len(chosen), len(self._read)))))
        self._is_fresh = False

    def refresh(self) -> None:
        """Read the numbers of the points again before they are next used."""
        self._is_fresh = False

    def _refreshed(self) -> list[tuple[KernelsAtPoints, Indices, Array]]:
        """The sums with the present numbers of their points; a collective call.

        Raises:
            InputError: A number that the points lack, or that is not finite.
        """
        if self._is_fresh:
            return self._sums
        given = {s.text: self._carried[s.text] for s in self._read if s.text in self._carried}
        with ranks.raise_together(self._comm):
            for column, scalar in enumerate(self._read):
                values = self._values(scalar, given)
                for _, chosen, data in self._sums:
                    data[:, column] = values[chosen]
        self._is_fresh = True
        return self._sums

    def _values(self, scalar: ParticleScalar, given: Mapping[str, Array]) -> Array:
        """A number of each point, of those given by name or others; NaN at those of other ranks."""
        name, points, found = scalar.text, self._points, np.full(len(self._points), np.nan)
        mine = self._nearest >= 0
        if name.startswith("n["):
            return np.asarray(points.normal[:, int(name[2:-1])])
        if name in given:
            found = np.asarray(given[name], dtype=float)
        elif scalar.border:
            raise InputError(
                f"form {self._form.name} reads '{name}' at the border: expected its values at the "
                "points of the border"
            )
        else:
            found[mine] = self._of_particles(name, mine)
        bad = np.flatnonzero(mine & ~np.isfinite(found))
        if len(bad) and not (name == "K" and self._form.kinematics.deviatoric):
            raise InputError(
                f"form {self._form.name}: '{name}' is {found[bad[0]]:g} at the point "
                f"{position(points.x[bad[0]])} m of the border: expected a finite number"
            )
        return found

    def _of_particles(self, name: str, mine: Mask) -> Array:
        """A number of the nearest particles; an old field at the points themselves, by its gradient."""
        nearest, particles = self._nearest[mine], self._particles
        values = np.array(particles[name][nearest])
        if name.startswith("old ") and name.removeprefix("old ") in self._form.own_fields:
            for axis, letter in enumerate(self.cells.grid.space.axes):
                way = self._points.x[mine, axis] - particles[f"x[{axis}]"][nearest]
                values += way * particles[f"{name},{letter}"][nearest]
        return values

    def add_vector(self, vector: Array, coefficients: Array, *, absolute: bool) -> Array:
        """A vector on all coefficients plus that of this rank's points; a collective call.

        Args:
            vector: The vector of the particles.
            coefficients: Increments of all fields.
            absolute: Whether the absolute values of the contributions are added.
        """
        for kernels, _, data in self._refreshed():
            vector = vector + kernels.vector([data], coefficients, absolute=absolute)
        return vector

    def add_matrix(self, coefficients: Array, pattern: _rust.Pattern, values: Array) -> None:
        """Add the derivative to the values of a reduced matrix; a collective call.

        Args:
            coefficients: Increments of all fields.
            pattern: Pattern of the matrix of this rank's particles.
            values: Its values.
        """
        for kernels, _, data in self._refreshed():
            kernels.write_matrix([data], coefficients, pattern, values, add=True)


def parts_of(points: BorderPoints, on: tuple[str, ...] | None, form: str) -> Mask:
    """Points on the parts of a border with these names, or on all of it.

    Args:
        points: The points.
        on: The names; None for all points.
        form: Name of the form, for messages.

    Raises:
        InputError: The border has no part of a name.
    """
    if on is None:
        return np.ones(len(points), dtype=bool)
    unknown = [name for name in on if name not in points.names]
    if unknown:
        raise InputError(
            f"form {form}: sum_b(..., on={quoted(unknown)}), and the border of the body has the parts "
            f"{quoted(points.names) or 'none'}: expected one of these"
            f"{meant(unknown[0], points.names)}"
        )
    return np.asarray(np.isin(points.tag, [points.names.index(name) for name in on]))


def _nearest(particles: Any, cell: Indices, xi: Array, mine: Mask) -> Indices:
    """The nearest particle in the cell of each point of this rank; -1 for points of other ranks.

    Args:
        particles: Location of this rank's particles.
        cell, xi: Cells of the points in the window, and positions in them.
        mine: Whether each point is in a cell of this rank.
    """
    from scipy.spatial import cKDTree

    number = np.full(len(mine), -1)

    def apart(cells: Any, positions: Any) -> Array:
        order = np.searchsorted(particles.active, cells)
        return np.column_stack([positions, APART * order])

    if mine.any():
        tree = cKDTree(apart(particles.cell, np.asarray(particles.xi)))
        number[mine] = tree.query(apart(cell[mine], xi[mine]))[1]
    return number
