"""The body on its grid between two resets: particles in their cells, border, sources of fields."""
