"""What a driver script builds, and one accepted step of it."""

from tawami.scene.scene import Scene
from tawami.scene.solution import Solution
from tawami.scene.sources import earlier, table

__all__ = ["Scene", "Solution", "earlier", "table"]
