"""What a driver script builds, and one accepted step of it."""

from tawami.scene.earlier import earlier
from tawami.scene.scene import Scene
from tawami.scene.solution import Solution
from tawami.scene.table import table

__all__ = ["Scene", "Solution", "earlier", "table"]
