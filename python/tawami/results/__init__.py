"""Observers of a run: files, checkpoints, log and pictures."""
