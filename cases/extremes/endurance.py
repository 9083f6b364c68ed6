"""A long run of a small scene: memory that the process has taken and not given back.

Measured with the C library's own count of what is in use (mallinfo2, glibc), after the first steps have
filled the caches of Python, PETSc, MUMPS and of the C library; over ten thousand steps also what the
process holds (Linux), its open files, and the objects of PETSc that there are.
"""

from __future__ import annotations

import ctypes
import gc
import os
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

import tawami
from cases.extremes import block
from cases.extremes.attempt import Attempt, attempted
from tawami.fem.environment import MAPS

SUBJECT = "endurance"
#: Bytes that a step may leave behind: a leaked vector of the grid has 5 kB, the smallest object of
#: PETSc 1 kB. Patterns of the matrix that are larger than all before make it grow a little, late too.
BOUND = 500.0


#: The same of the memory that the process holds, over the last half of a run. It grows by whole pages of
#: 4 kB, and with the largest pattern so far.
RESIDENT = 500.0


class _Mallinfo(ctypes.Structure):
    """What glibc says of its memory [bytes]."""

    _fields_ = [
        (name, ctypes.c_size_t)
        for name in (
            "arena", "ordblks", "smblks", "hblks", "hblkhd", "usmblks", "fsmblks", "uordblks",
            "fordblks", "keepcost",
        )
    ]  # fmt: skip


def in_use() -> int:
    """Memory in use [bytes]."""
    gc.collect()
    library = ctypes.CDLL(None)
    library.mallinfo2.restype = _Mallinfo
    now = library.mallinfo2()
    return int(now.uordblks + now.hblkhd)


def growth(form: str, first: int, steps: int, **options: Any) -> float:
    """Bytes a step that are in use after `steps` steps and were not after the `first`."""
    motion = block.spinning(block.scene(form, **options), 2.0)
    start = 0
    for step in range(first + steps):
        if step == first:
            start = in_use()
        motion.step(0.004)
    return max(in_use() - start, 0) / steps


class _Counter(ctypes.Structure):
    """What PETSc keeps with a communicator: the second number is that of the objects on it."""

    _fields_ = [("tag", ctypes.c_int), ("objects", ctypes.c_int)]


#: In place of a number of objects.
HIDDEN = -1


def objects() -> int:
    """Objects of PETSc that there are, on the communicators of all ranks and of this one alone; HIDDEN
    where PETSc does not tell (Debian sid's 3.25).
    """
    (library,) = {line.split()[-1] for line in MAPS.read_text().splitlines() if "libpetsc" in line}
    try:
        key = ctypes.c_int.in_dll(ctypes.CDLL(library), "Petsc_Counter_keyval").value
    except ValueError:
        return HIDDEN
    there = 0
    for comm in (MPI.COMM_WORLD, MPI.COMM_SELF):
        probe = PETSc.Vec().createMPI((1, PETSc.DETERMINE), comm=comm)
        there += _Counter.from_address(probe.comm.tompi4py().Get_attr(key)).objects - 1
        probe.destroy()
    return int(there)


def resident() -> int:
    """Memory that the process holds [bytes]."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def held(form: str, steps: int) -> tuple[float, str]:
    """Bytes a step by which the process grows over the last half of a run: slope of the line of least
    squares. The block hangs from points and vibrates, at finite strain it spins; its solutions are
    dropped, and the records of `run`, which have about 600 bytes a step.

    Raises:
        RuntimeError: In the last half there are more files or objects of PETSc than ever in the first.
    """
    scene = block.scene(form)
    if form in block.FINITE:
        motion = block.spinning(scene, 2.0)
    else:
        for y in (-block.SIDE / 2, block.SIDE / 2):
            for component in ("x", "y"):
                scene.hold((-block.SIDE / 2, y), component)
        scene.gravity((0.0, -9.81))
        motion = tawami.Dynamics(scene)
    found, every = list[tuple[int, int, int]](), max(steps // 40, 1)

    def look(_: tawami.Solution) -> None:
        if motion.steps % every == 0:
            gc.collect()
            found.append((resident(), len(os.listdir("/proc/self/fd")), objects()))

    for part in range(every, steps + 1, every):
        motion.run(end=1e-3 * part, dt=1e-3, each=look)
    bytes_held, files, there = np.array(found).T
    half = len(found) // 2
    for name, counts in (("files", files), ("objects of PETSc", there)):
        if counts[half:].max() > counts[:half].max():
            raise RuntimeError(f"{name}: {counts[:half].max()}, later {counts[half:].max()}")
    slope = np.polyfit(every * np.arange(half, len(found)), bytes_held[half:], 1)[0]
    counted = (
        "objects of PETSc not told" if there[-1] == HIDDEN else f"{there[-1]} objects of PETSc"
    )
    remark = f"{bytes_held[-1] / 2**20:.0f} MB, {files[-1]} files, {counted}"
    return max(float(slope), 0.0), remark


def scenes(number: int, *, one_grid: bool = False) -> float:
    """Bytes a scene that are in use after so many were made, stepped and dropped; each on a grid of its
    own, or all on one.
    """
    shared = block.scene().grid if one_grid else None

    def once() -> None:
        tawami.Dynamics(block.scene(grid=shared)).step(0.004)

    for _ in range(number):
        once()
    start = in_use()
    for _ in range(number):
        once()
    return max(in_use() - start, 0) / number


def attempts(short: bool) -> Iterator[Attempt]:
    """Steps of each form and path, and scenes."""
    first, steps = (100, 150) if short else (300, 1000)
    for form in ("u_epsv_finite",) if short else ("u_epsv_finite", "u_bbar_finite"):
        yield attempted(
            SUBJECT, f"{form}, bytes a step, {steps} steps after {first}", BOUND,
            partial(growth, form, first, steps),
        )  # fmt: skip
    if not short:
        yield attempted(
            SUBJECT, "reference assembly, bytes a step, 300 steps after 200", BOUND,
            partial(growth, "u_epsv_finite", 200, 300, assembly="reference"),
        )  # fmt: skip
    number = 20 if short else 1000
    for one_grid in (False, True):
        where = "on one grid" if one_grid else "a grid each"
        yield attempted(
            SUBJECT, f"bytes a scene, {number} scenes, {where}", BOUND,
            partial(scenes, number, one_grid=one_grid),
        )  # fmt: skip
    steps = 120 if short else 10_000
    for form in ("u_epsv_finite",) if short else ("u_epsv", "u_epsv_finite"):
        yield attempted(
            SUBJECT, f"{form}, bytes a step that the process grows, {steps} steps",
            RESIDENT * (20 if short else 1), partial(held, form, steps),
        )  # fmt: skip
