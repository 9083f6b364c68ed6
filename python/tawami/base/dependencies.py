"""MPI and PETSc: imported before anything else, with advice on how to install them."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
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


#: Settings with which Open MPI starts a process that no launcher started. Such a process sends no
#: messages: it needs no search for networks, which waits for 0.3 s, and no daemon.
ALONE = {"OMPI_MCA_pml": "ob1", "OMPI_MCA_ess_singleton_isolated": "1"}
#: Variables of processes that mpirun, srun or another launcher started begin with one of these.
LAUNCHED = ("OMPI_COMM_WORLD_", "PMIX_", "PMI_")


@contextmanager
def quick_start() -> Iterator[None]:
    """Let MPI start faster within the block, in a process that no launcher started.

    Variables that the environment sets already are not changed.
    """
    launched = any(name.startswith(LAUNCHED) for name in os.environ)
    added = {} if launched else {k: v for k, v in ALONE.items() if k not in os.environ}
    os.environ.update(added)
    try:
        yield
    finally:
        for name in added:  # a program that this process starts may have networks to search for
            del os.environ[name]


try:
    with quick_start():
        import mpi4py.MPI  # noqa: F401
    import petsc4py

    if "petsc4py.PETSc" not in sys.modules:
        # with its signal handler, PETSc reports a closed pipe (| head) as a crash and aborts MPI
        petsc4py.init(["tawami", "-no_signal_handler"])
    from petsc4py import PETSc

    if find_spec("dolfinx") is None:  # imported when it is needed
        raise ImportError("No module named 'dolfinx'")
except ImportError as error:  # pragma: no cover - exercised in a subprocess by the tests
    report_missing(error)

#: Advice on the installation of the right PETSc.
ADVICE = "On Debian: apt install python3-dolfinx-real python3-petsc4py-real, and unset PETSC_DIR"

if np.dtype(PETSc.ScalarType) != np.float64:
    raise MissingDependencyError(
        "tawami needs PETSc with real numbers, but its scalars are "
        f"{np.dtype(PETSc.ScalarType)}. {ADVICE}"
    )

if np.dtype(PETSc.IntType) != np.int32:
    raise MissingDependencyError(
        f"tawami needs PETSc with 32-bit indices, but they are {np.dtype(PETSc.IntType)}. {ADVICE}"
    )
