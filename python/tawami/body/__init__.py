"""Shapes that are filled with particles; a body knows no material and no form."""
