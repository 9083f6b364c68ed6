"""Actions on a body: supports, loads, walls and rigid obstacles."""
