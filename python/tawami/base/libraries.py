"""MPI and PETSc, imported in an order and with options that suit scripts.

Every import of them in the package comes after this module.
"""

from __future__ import annotations

import contextlib
import sys

import numpy as np

from tawami.base.errors import MissingDependencyError

__all__ = ["MPI", "PETSc", "missing"]


def missing(error: ImportError) -> MissingDependencyError:
    """The error for a missing library, with the packages that hold it."""
    return MissingDependencyError(
        f"tawami needs dolfinx with real PETSc, and importing it failed: {error}. On Debian or "
        "Ubuntu: apt install python3-dolfinx-real python3-petsc4py-real python3-mpi4py, and run "
        "Python from a virtual environment made by /usr/bin/python3 -m venv --system-site-packages"
    )


if "petsc4py" not in sys.modules:
    # PETSc's signal handler reports a closed pipe (| head) as a crash and aborts MPI
    with contextlib.suppress(ImportError):
        import petsc4py

        petsc4py.init(["tawami", "-no_signal_handler"])

try:
    from mpi4py import MPI
    from petsc4py import PETSc
except ImportError as error:  # pragma: no cover - exercised in a subprocess by the tests
    raise missing(error) from error

if np.dtype(PETSc.ScalarType) != np.float64:
    raise MissingDependencyError(
        f"tawami needs PETSc with real numbers, but its scalars are {np.dtype(PETSc.ScalarType)}. "
        "On Debian: apt install python3-dolfinx-real python3-petsc4py-real, and unset PETSC_DIR"
    )

if np.dtype(PETSc.IntType) != np.int32:
    raise MissingDependencyError(
        f"tawami needs PETSc with 32-bit indices, but its are {np.dtype(PETSc.IntType)}. On Debian: "
        "apt install python3-dolfinx-real python3-petsc4py-real, and unset PETSC_DIR"
    )
