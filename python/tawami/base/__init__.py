"""Code without mechanics: errors, input checks, ranks, PETSc handles, signals, files, timing."""

from tawami.base import dependencies  # isort: skip  # before any other module imports MPI or PETSc
from tawami.base.files import atomic_file, result_folder
from tawami.base.program import run

__all__ = ["atomic_file", "dependencies", "result_folder", "run"]
