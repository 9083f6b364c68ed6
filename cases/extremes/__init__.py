"""Limits of the method: settings that it survives, and settings that it rejects.

python -m cases.extremes
"""
