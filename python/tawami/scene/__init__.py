"""What a driver script builds, and one accepted step of it."""
