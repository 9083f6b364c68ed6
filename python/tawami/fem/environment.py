"""The environment of a run: versions, the loaded BLAS, threads, memory."""

from __future__ import annotations

import os
import platform
import resource
from pathlib import Path

import numpy as np
from petsc4py import PETSc

from tawami._rust import __version__
from tawami.base.dependencies import CORE
from tawami.fem import dolfinx

#: Libraries that this process has loaded (Linux).
MAPS = Path("/proc/self/maps")
#: Status of this process (Linux).
STATUS = Path("/proc/self/status")


def blas() -> tuple[str, bool]:
    """Name of the BLAS library that PETSc uses, and whether it is the slow reference BLAS.

    It is found among the loaded libraries (Linux), and 'unknown' elsewhere.
    """
    try:
        maps = MAPS.read_text().splitlines()
    except OSError:
        return "unknown", False
    loaded = {Path(line.split()[-1]) for line in maps if ".so" in line}
    for path in sorted(loaded):
        if path.name.startswith("libblas.so"):
            # Debian links libblas.so.3 to the chosen implementation, in a folder with its name
            kind = path.resolve().parent.name
            return (f"reference BLAS ({path})", True) if kind == "blas" else (kind, False)
    for path in sorted(loaded):
        if any(name in path.name for name in ("openblas", "blis", "mkl")):
            return path.name, False
    return "unknown", False


def peak_memory() -> float:
    """Peak memory of this process [MB].

    On Linux this is VmHWM: the value of `getrusage` includes the memory of the parent at the start.
    """
    try:
        lines = STATUS.read_text().splitlines()
        (line,) = (line for line in lines if line.startswith("VmHWM:"))
        return int(line.split()[1]) / 1024
    except (OSError, ValueError):
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def versions() -> dict[str, str]:
    """Versions of the packages that a result depends on."""
    return {
        "tawami": __version__,
        "dolfinx": dolfinx.version,
        "PETSc": ".".join(map(str, PETSc.Sys.getVersion())),
        "Python": platform.python_version(),
        "NumPy": np.__version__,
    }


def header() -> str:
    """A line for the start of a run, with a warning below it if the BLAS is slow."""
    name, slow = blas()
    if CORE.name:
        name += f" ({CORE})"
    line = ", ".join(f"{package} {number}" for package, number in versions().items())
    line += (
        f", BLAS {name}, OMP_NUM_THREADS={os.environ.get('OMP_NUM_THREADS', 'unset')}, "
        f"{os.cpu_count()} processors"
    )
    if slow:
        line += (
            "\nWarning: the reference BLAS makes the factorisation 3 to 5 times slower. On Debian: "
            "apt install libopenblas0-serial"
        )
    elif CORE.advice:
        line += f"\nWarning: {CORE.advice}"
    return line
