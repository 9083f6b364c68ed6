"""The border of a body: its pieces, points and patches, and the rigid obstacles that it touches."""
