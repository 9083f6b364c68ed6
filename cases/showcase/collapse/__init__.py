"""A pile of aluminium rods collapses under its own weight.

python -m cases.showcase.collapse
"""
