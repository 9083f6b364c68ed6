"""Quantities of the particles by name: arrays, pictures and tables."""
