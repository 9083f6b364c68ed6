"""The background grid before there are particles: `Grid`, `Space`, edges and one-dimensional bases."""
