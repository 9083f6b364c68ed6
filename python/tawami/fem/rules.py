"""Quadrature rules: the points of a cell where particle data enter a weak form."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from typing import Literal

import numpy as np

from tawami.base.arrays import Array
from tawami.base.space import PLANE
from tawami.fem.dolfinx import basix, reference_nodes

#: Rules of particle densities: the full rule, the centre of the cell, its vertices; or cell means.
Rule = Literal["particle", "centre", "vertex", "mean"]

#: Quadrature degree of each rule. 5 x 5 points make the tangent of quadratic splines exact.
DEGREE: Mapping[Rule, int] = {"particle": 8, "centre": 1, "vertex": 1}
#: Family of each rule; the points of the smallest Gauss-Lobatto-Legendre rule are the vertices.
FAMILY: Mapping[Rule, str] = {**dict.fromkeys(DEGREE, "default"), "vertex": "GLL"}


@functools.cache
def reference_points(degree: int) -> Array:
    """Points of the quadrature rule of a degree: points x 2, in reference axes."""
    points = basix.make_quadrature(basix.CellType.quadrilateral, degree)[0]
    return np.asarray(points, dtype=np.float64)


def triangle_rule(degree: int) -> tuple[Array, Array]:
    """Points and weights on the triangle (0, 0), (1, 0), (0, 1), all inside and positive."""
    points, weights = basix.make_quadrature(basix.CellType.triangle, degree)
    return np.asarray(points, dtype=np.float64), np.asarray(weights, dtype=np.float64)


def rule_points(rule: Rule) -> Array:
    """Points of a rule of densities, points x dim; none for means over cells."""
    if rule == "mean":
        return np.empty((0, PLANE.dim))
    return reference_nodes(1) if rule == "vertex" else reference_points(DEGREE[rule])
