"""Costs of a run: time, memory and accuracy."""
