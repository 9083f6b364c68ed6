"""The checks behind `tawami form check`."""
