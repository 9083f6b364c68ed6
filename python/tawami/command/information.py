"""The command `tawami info`: versions, BLAS, threads, memory, ranks, compiler, missing packages, and a
self test.
"""

from __future__ import annotations

import importlib.metadata
import importlib.util
import os
import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Iterator
from pathlib import Path
from time import perf_counter

from mpi4py import MPI

from tawami.base import program
from tawami.base.errors import TawamiError
from tawami.base.text import labelled
from tawami.check import scenes
from tawami.fem import cache, environment
from tawami.form.form import Form

MEMORY = Path("/proc/meminfo")
#: Optional packages and their purposes.
OPTIONAL = (
    ("matplotlib", "figures, tawami plot"),
    ("tqdm", "progress in notebooks and of the cases"),
    ("pandas", "solution.to_pandas()"),
    ("pyvista", "solution.to_pyvista()"),
)


def lines() -> Iterator[tuple[str, str]]:
    """Label and text of each line except the self test."""
    versions, *warning = environment.header().splitlines()
    yield "versions", versions
    if warning:
        yield "", warning[0]
    yield "threads", _threads()
    yield "memory", _memory()
    yield "ranks", _ranks()
    yield "compiler", _compiler()
    yield "kernels", f"compiled forms, in {cache.cache_directory()}"
    for name, purpose in OPTIONAL:
        yield name, _package(name, purpose)
    yield "ffmpeg", _program("ffmpeg", "movies as MP4")


def show() -> int:
    """Print the lines and the self test; return the exit code."""
    for label, text in lines():
        print(labelled(label, text))
    good, text = self_test()
    print(labelled("self test", text))
    return 0 if good else 1


def _threads() -> str:
    usable = len(os.sched_getaffinity(0))
    rayon = os.environ.get("RAYON_NUM_THREADS", f"unset: {usable}, all processors of this process")
    return (
        f"OMP_NUM_THREADS {os.environ.get('OMP_NUM_THREADS', 'unset')}, RAYON_NUM_THREADS {rayon}"
    )


def _memory() -> str:
    """Memory as Linux reports it."""
    try:
        told = dict(line.split(":") for line in MEMORY.read_text().splitlines())
        total, free = (int(told[key].split()[0]) / 2**20 for key in ("MemTotal", "MemAvailable"))
    except (OSError, KeyError, ValueError):
        return "unknown"
    return f"{total:.3g} GB, {free:.3g} GB of it available"


def _ranks() -> str:
    library = MPI.Get_library_version().splitlines()[0].split("\x00")[0].strip().rstrip(",")
    starts = shutil.which("mpirun") or "no mpirun: apt install openmpi-bin"
    text = f"{MPI.COMM_WORLD.size} now; {library}; {starts}"
    missing = [name for name in program.AS_ROOT if name not in os.environ]
    if os.geteuid() == 0 and missing:
        text += f". As root, mpirun needs: export {' '.join(f'{name}=1' for name in missing)}"
        text += " (tawami run --ranks sets them)"
    return text


def _compiler() -> str:
    """The compiler of the code of FFCx."""
    command = (os.environ.get("CC") or sysconfig.get_config_var("CC") or "cc").split()[0]
    advice = "apt install g++ python3-dev"
    try:
        said = subprocess.run([command, "--version"], capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return f"MISSING: '{command}', which compiles forms: {advice}"
    if not Path(sysconfig.get_path("include"), "Python.h").exists():
        return f"{command}, but Python's headers are MISSING: {advice}"
    return said.stdout.splitlines()[0]


def _package(name: str, purpose: str) -> str:
    if importlib.util.find_spec(name) is None:
        return f"missing ({purpose}): {sys.executable} -m pip install {name}"
    return f"{importlib.metadata.version(name)} ({purpose})"


def _program(name: str, purpose: str) -> str:
    return shutil.which(name) or f"missing ({purpose}): apt install {name}"


def self_test() -> tuple[bool, str]:
    """Compare the stress of a small scene with its closed form."""
    start = perf_counter()
    try:
        error = scenes.compressed(Form.load("u_epsv"), {}, "quadratic_spline")
    except TawamiError as failure:
        return False, f"FAILED: {failure}"
    good = error < 1e-10
    text = (
        f"a block under a traction, error of its stress {error:.1e}, {perf_counter() - start:.1f} s"
    )
    return good, f"ok: {text}" if good else f"FAILED: {text}: expected below 1e-10"
