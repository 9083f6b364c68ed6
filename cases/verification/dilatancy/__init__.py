"""Dilatant plasticity: a pressed block, and all active sets of the rate problem of a patch."""
