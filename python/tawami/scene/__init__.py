"""The objects of a driver script, and one accepted step."""

from tawami.domain.earlier import earlier
from tawami.domain.table import table
from tawami.scene.scene import Scene
from tawami.scene.solution import Solution

__all__ = ["Scene", "Solution", "earlier", "table"]
