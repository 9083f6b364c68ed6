"""The command `tawami`."""
