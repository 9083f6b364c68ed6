"""Shapes -> particles: `box`, `disc`, `polygon`, `level_set` and `mesh` return a `Body`."""
