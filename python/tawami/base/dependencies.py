"""MPI and PETSc: imported before anything else, with advice on how to install them."""

from __future__ import annotations

import sys
from typing import NoReturn

import numpy as np

from tawami.base import blas
from tawami.base.errors import MissingDependencyError

#: Kernels of the BLAS, chosen before MPI starts.
CORE = blas.choose()


def report_missing(error: ImportError) -> NoReturn:
    """Raise an error if a package for the field problem cannot be imported."""
    raise MissingDependencyError(
        f"tawami needs dolfinx with real PETSc, and importing it failed: {error}. On Debian or "
        "Ubuntu: apt install python3-dolfinx-real python3-petsc4py-real python3-mpi4py, and run "
        "Python from a virtual environment made by /usr/bin/python3 -m venv --system-site-packages"
    ) from error


try:
    import mpi4py.MPI  # noqa: F401
    import petsc4py

    if "petsc4py.PETSc" not in sys.modules:
        # with its signal handler, PETSc reports a closed pipe (| head) as a crash and aborts MPI
        petsc4py.init(["tawami", "-no_signal_handler"])
    from petsc4py import PETSc
except ImportError as error:  # pragma: no cover - exercised in a subprocess by the tests
    report_missing(error)

#: How to install the right PETSc.
ADVICE = "On Debian: apt install python3-dolfinx-real python3-petsc4py-real, and unset PETSC_DIR"

if np.dtype(PETSc.ScalarType) != np.float64:
    raise MissingDependencyError(
        "tawami needs PETSc with real numbers, but its scalars are "
        f"{np.dtype(PETSc.ScalarType)}. {ADVICE}"
    )

if np.dtype(PETSc.IntType) != np.int32:
    raise MissingDependencyError(
        f"tawami needs PETSc with 32-bit indices, but its are {np.dtype(PETSc.IntType)}. {ADVICE}"
    )
