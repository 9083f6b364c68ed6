"""Limits of the method: what it survives, what it rejects, and where.

python -m cases.extremes
"""
