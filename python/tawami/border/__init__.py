"""The border of a body: its pieces, points and patches on it, and the rigid obstacles that it touches."""
