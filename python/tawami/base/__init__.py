"""What knows no mechanics: errors, input checks, ranks, PETSc handles, signals, files, timing."""

from tawami.base import dependencies  # before any other module imports MPI or PETSc

__all__ = ["dependencies"]
