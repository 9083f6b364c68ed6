"""Quadrature rules: where on a cell the data of particles are given to a weak form."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

#: Points that densities are given at: the full rule, a smaller one for tangents, the cell's centre, its
#: vertices; or one mean per cell.
Rule = Literal["particle", "reduced", "centre", "vertex", "mean"]

#: Quadrature degree of each rule: 5 x 5 points make the tangent of quadratic splines exact, the 3 x 3 of
#: the reduced rule do not (they are exact up to degree 2 along each axis).
DEGREE: Mapping[Rule, int] = {"particle": 8, "reduced": 4, "centre": 1, "vertex": 1}
#: Family of each rule: the points of Gauss-Lobatto-Legendre's smallest are the vertices.
FAMILY: Mapping[Rule, str] = {**dict.fromkeys(DEGREE, "default"), "vertex": "GLL"}
#: Rule of the tangent: the full one, or the smaller one, which is cheaper and may not converge.
TangentRule = Literal["full", "reduced"]
