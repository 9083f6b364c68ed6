"""Cases that show what the method can do."""
