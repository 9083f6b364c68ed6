"""The background grid before there are particles: cells, edges and one-dimensional bases."""

from tawami.grid.grid import Grid

__all__ = ["Grid"]
