"""The objects of a driver script, and one accepted step."""

from tawami.scene.earlier import earlier
from tawami.scene.scene import Scene
from tawami.scene.solution import Solution
from tawami.scene.table import table

__all__ = ["Scene", "Solution", "earlier", "table"]
