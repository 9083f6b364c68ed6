"""All that knows no mechanics: errors, checks of input, ranks, PETSc handles, signals, files, timing."""

from tawami.base.files import atomic_file, result_folder
from tawami.base.program import run

__all__ = ["atomic_file", "result_folder", "run"]
