"""The border of a body as straight pieces and arcs."""

from __future__ import annotations

from dataclasses import dataclass

from tawami.base.arrays import Array, Indices


@dataclass(frozen=True)
class Border:
    """Straight pieces and arcs, with the body on the left of the way from start to end.

    Attributes:
        start: Where each piece starts [m], pieces x dim.
        end: Where it ends [m].
        curvature: Of each piece [1/m]: 0 for a straight one, positive for an arc around a centre on
            the side of the body, negative for one around a centre outside. Arcs are shorter than a
            half circle.
        tag: Number of the name of each piece among `names`.
        names: Names of the parts of the border.
    """

    start: Array
    end: Array
    curvature: Array
    tag: Indices
    names: tuple[str, ...]
