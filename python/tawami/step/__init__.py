"""One accepted step: its start, its problem, its solution, and the changes that are stored."""
