"""OpenBLAS on processors that it does not know.

A build of OpenBLAS holds kernels for many processors (core types) and chooses among them when it is
loaded. Version 0.3.21 (Debian 12) does not know recent processors and takes SSE3 kernels ("Prescott")
for them, which halve the speed of a factorisation. :func:`choose` replaces these by kernels for the
vector instructions that the processor has.

OpenBLAS reads the core type from OPENBLAS_CORETYPE, and reads it again when it is initialised again. So
the kernels can be replaced after another package (NumPy) has loaded it.
"""

from __future__ import annotations

import ctypes
import os
import time
import warnings
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

VARIABLE = "OPENBLAS_CORETYPE"
#: The BLAS that Debian's PETSc and MUMPS are linked to.
LIBRARY = "libblas.so.3"
#: Core types without AVX. A processor with AVX2 has one of them only if OpenBLAS does not know it.
FALLBACKS = ("Prescott", "Core2", "Nehalem", "Barcelona", "Generic")
#: Core types, the best first, and the instructions that each of them needs.
CHOICES = {
    "SkylakeX": {"avx2", "fma", "avx512f", "avx512cd", "avx512bw", "avx512dq", "avx512vl"},
    "Haswell": {"avx2", "fma"},
}
#: Processors and their instructions (Linux).
PROCESSORS = Path("/proc/cpuinfo")
#: C types of the arguments of a Fortran subroutine.
TYPES: dict[type, Any] = {bytes: ctypes.c_char, int: ctypes.c_int, float: ctypes.c_double}
#: Time limit of the trial of a core type [s].
TRIAL = 5.0


@dataclass(frozen=True)
class Core:
    """The kernels of the loaded OpenBLAS.

    Attributes:
        name: Core type; empty if the BLAS is another library.
        instead_of: Core type that OpenBLAS took by itself, if it was replaced.
        advice: Advice on slow kernels that were kept; empty if there are none.
    """

    name: str = ""
    instead_of: str = ""
    advice: str = ""

    def __str__(self) -> str:
        instead = f" in place of {self.instead_of}" if self.instead_of else ""
        return f"kernels for {self.name}{instead}"


def choose() -> Core:
    """Replace the kernels of OpenBLAS if they are a fallback; the kernels in use.

    A core type that the environment sets is kept, and so is everything if the BLAS is another library,
    the processor is another architecture, or the kernels fail their trial.
    """
    try:
        library = ctypes.CDLL(LIBRARY)
        get = library.openblas_get_corename
    except (OSError, AttributeError):
        return Core()
    get.restype = ctypes.c_char_p
    name = get().decode()
    wanted = suitable(name)
    if not wanted:
        return Core(name)
    if not hasattr(library, "gotoblas_dynamic_quit") or not _passes(library, wanted):
        return Core(
            name,
            advice=f"OpenBLAS does not know this processor, and its kernels for {name} make the "
            f"factorisation 1.6 to 2.1 times slower. Those for {wanted} could not be used: install a "
            "newer OpenBLAS",
        )
    _initialise(library, wanted)
    return Core(get().decode(), instead_of=name)


def suitable(name: str) -> str:
    """A better core type for this processor than `name`; empty if there is none.

    Args:
        name: Core type that OpenBLAS took.
    """
    if VARIABLE in os.environ or name not in FALLBACKS:
        return ""
    has = _instructions()
    return next((choice for choice, needed in CHOICES.items() if needed <= has), "")


def _instructions() -> set[str]:
    """Instructions of the processor that the system supports, as x86-64 names them."""
    try:
        lines = PROCESSORS.read_text().splitlines()
    except OSError:
        return set()
    return set(next((line for line in lines if line.startswith("flags")), "").split())


def _initialise(library: ctypes.CDLL, name: str) -> None:
    """Let OpenBLAS use the kernels of a core type. No other thread may call it meanwhile."""
    os.environ[VARIABLE] = name
    try:
        library.gotoblas_dynamic_quit()
        library.gotoblas_dynamic_init()
    finally:
        del os.environ[VARIABLE]


def _passes(library: ctypes.CDLL, name: str) -> bool:
    """Whether the kernels of a core type run here and give the right results.

    They run in a child process, because an instruction that does not exist ends the process.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of threads: the child calls nothing but OpenBLAS
            child = os.fork()
    except OSError:  # a limit of processes
        return False
    if not child:
        passed = False
        try:
            _initialise(library, name)
            passed = library.openblas_get_corename().decode() == name and multiplies(library)
        finally:
            os._exit(0 if passed else 1)
    end = time.monotonic() + TRIAL
    with suppress(ChildProcessError):  # a parent that ignores SIGCHLD never sees how it ended
        while time.monotonic() < end:
            done, status = os.waitpid(child, os.WNOHANG)
            if done:
                return status == 0
            time.sleep(2e-4)
        os.kill(child, 9)
        os.waitpid(child, 0)
    return False


def multiplies(library: ctypes.CDLL) -> bool:
    """Whether products and triangular solves are those of plain loops.

    All numbers are small integers, for which floating-point results are exact.
    """
    random = np.random.default_rng(0)
    for m, n, k in ((1, 5, 3), (37, 29, 61), (70, 35, 130)):
        a, b = (np.asfortranarray(random.integers(-3, 4, s)) for s in ((m, k), (k, n)))
        for transposed in (False, True):
            left = np.asfortranarray(a.T if transposed else a, dtype=float)
            product = np.zeros((m, n), order="F")
            _call(
                library.dgemm_, b"T" if transposed else b"N", b"N", m, n, k, 1.0, left, len(left),
                b.astype(float), k, 0.0, product, m,
            )  # fmt: skip
            if not np.array_equal(product, a @ b):
                return False
        vector = np.zeros(m)
        _call(library.dgemv_, b"N", m, k, 1.0, a.astype(float), m, b[:, 0].astype(float), 1, 0.0,
              vector, 1)  # fmt: skip
        if not np.array_equal(vector, a @ b[:, 0]):
            return False
        triangle = np.tril(random.integers(0, 2, (m, m)), -1) + np.eye(m, dtype=int)
        expected = random.integers(-3, 4, (m, n))
        found = np.asfortranarray(triangle @ expected, dtype=float)
        _call(library.dtrsm_, b"L", b"L", b"N", b"U", m, n, 1.0,
              np.asfortranarray(triangle, dtype=float), m, found, m)  # fmt: skip
        if not np.array_equal(found, expected):
            return False
    return True


def _call(function: Any, *arguments: bytes | int | float | np.ndarray[Any, Any]) -> None:
    """Call a Fortran subroutine."""
    pointers = [
        argument.ctypes.data_as(ctypes.c_void_p)
        if isinstance(argument, np.ndarray)
        else ctypes.byref(TYPES[type(argument)](argument))
        for argument in arguments
    ]
    function(*pointers)
