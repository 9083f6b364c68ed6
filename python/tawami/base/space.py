"""The space that bodies and fields live in: its dimension, names of components, cell measure, units.

This is the only place that says that the grid is plane. Code that is not about the plane itself
(clipping polygons, discs) asks `grid.space`, and never writes 2, 4, "xy" or h**2. A grid in three
dimensions needs a second `Space`, a second form of `Position` and `Counts`, and that code.
`rust/space.rs` is the same for the Rust part.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from itertools import combinations, product
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from tawami.base.arrays import Array
from tawami.base.checks import one_of, shown
from tawami.base.errors import InputError

Scalar = TypeVar("Scalar", bound=np.generic)
#: One number per axis [m], and one count per axis.
Position = tuple[float, float]
Counts = tuple[int, int]


@dataclass(frozen=True)
class Space:
    """A space of some dimension.

    Material laws are three-dimensional in every space: plane strain keeps the component zz.

    Attributes:
        axes: Names of the axes.
        volume: Unit of the volume of a particle or a cell, in text.
        depth: Text after the units of extensive quantities: they refer to a metre of depth, or, where it
            is empty, to the whole body.
        hoop: Whether the first axis is the radius from the last: then zz is the hoop direction, whose
            strain follows from the displacement.
    """

    axes: tuple[str, ...]
    volume: str
    depth: str
    hoop: bool = False

    @property
    def dim(self) -> int:
        """Number of axes, and of components of a vector."""
        return len(self.axes)

    @property
    def tensor(self) -> tuple[str, ...]:
        """Names of the components of a symmetric tensor, in the order of `rust/tensor/mod.rs`."""
        return ("xx", "yy", "zz", *("".join(pair) for pair in combinations(self.axes, 2)))

    @property
    def gradient(self) -> tuple[str, ...]:
        """Names of the components of the gradient of a vector: component, then derivative; the hoop
        strain last.
        """
        hoop = ("zz",) if self.hoop else ()
        return (*("".join(pair) for pair in product(self.axes, repeat=2)), *hoop)

    @property
    def num_strains(self) -> int:
        """Components of a strain: xx, yy, gamma_xy in the plane; the hoop strain last."""
        return self.dim * (self.dim + 1) // 2 + self.hoop

    @property
    def num_vertices(self) -> int:
        """Vertices of a cell."""
        return 1 << self.dim

    def measure(self, h: float) -> float:
        """Area or volume of a cell of side `h` [m]."""
        return h**self.dim

    def vectors(self, components: Array) -> Array:
        """Vectors, n x dim, of their components in one array, those of one vector after each other."""
        return components.reshape(-1, self.dim)

    def tensors(self, components: Array) -> Array:
        """Tensors, n x dim x dim, of their components in one array, as :meth:`vectors`."""
        return components.reshape(-1, self.dim, self.dim)

    def gradients(self, components: Array) -> Array:
        """Gradients of displacements, n x rows x rows: the hoop direction has a row too."""
        rows = self.dim + self.hoop
        return components.reshape(-1, rows, rows)

    def unit(self, unit: str) -> str:
        """Unit of an extensive quantity, per metre depth or of the whole body: 'N per m', 'N'."""
        return unit + self.depth

    def short(self, unit: str) -> str:
        """The same in short: 'N/m', 'N'."""
        return unit + self.depth.replace(" per ", "/")

    def thickness(self, x: Array) -> Array:
        """Volume per area of the plane at positions x, n x dim: 1, or 2 pi r, r the radius [m]."""
        return 2 * np.pi * x[:, 0] if self.hoop else np.ones(len(x))

    def resultant(self, vector: Array) -> Array:
        """A sum of vectors over the body; those along a radius cancel."""
        return np.array([0.0, *vector[1:]]) if self.hoop else vector

    def in_space(self, gradients: Array) -> Array:
        """Gradients, n x rows x rows, without the hoop direction: n x dim x dim."""
        return gradients[:, : self.dim, : self.dim]

    def axis(self, component: str) -> int:
        """Number of the axis with that name.

        Raises:
            InputError: No such axis.
        """
        if not one_of(component, self.axes):
            expected = " or ".join(map(repr, self.axes))
            raise InputError(f"component {shown(component)}: expected {expected}")
        return self.axes.index(component)


#: Plane strain.
PLANE = Space(axes=("x", "y"), volume="m2", depth=" per m")
#: Axisymmetry: x is the radius, y the axis, and zz the hoop direction.
AXISYMMETRIC = Space(axes=("x", "y"), volume="m3", depth="", hoop=True)
#: The spaces of a grid by the name of its geometry.
SPACES: Mapping[str, Space] = {"plane_strain": PLANE, "axisymmetric": AXISYMMETRIC}


def lattice(along: Sequence[npt.NDArray[Scalar]]) -> npt.NDArray[Scalar]:
    """Points of a lattice, points x axes, given its coordinates along each axis; x fastest."""
    return np.stack([c.ravel(order="F") for c in np.meshgrid(*along, indexing="ij")], axis=-1)


def tensor_product(along: Sequence[Array]) -> Array:
    """Products of weights along each axis at the points of a lattice; x fastest."""
    return reduce(lambda inner, outer: np.outer(outer, inner).ravel(), along)
