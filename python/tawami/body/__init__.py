"""Shapes -> particles: `box`, `disc`, `polygon`, `level_set` and `mesh` return a `Body`."""

from tawami.body.body import Body
from tawami.body.box import box
from tawami.body.disc import disc
from tawami.body.level_set import level_set
from tawami.body.mesh import mesh
from tawami.body.polygon import polygon

__all__ = ["Body", "box", "disc", "level_set", "mesh", "polygon"]
