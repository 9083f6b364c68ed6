"""Shared parts of the cases: program, tables, figures and finite elements."""
