"""Long runs of small scenes: memory that the process does not release.

Memory in use is that of the C library (mallinfo2, glibc), counted after the first steps have filled the
caches of Python, PETSc, MUMPS and the C library. Over ten thousand steps the memory of the process
(Linux), its open files and its PETSc objects are counted too.
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

SUBJECT = "endurance"
#: Bytes that a step may leave in use. A leaked vector of the grid has 5 kB, the smallest object of PETSc
#: 1 kB. A matrix pattern that is larger than all before adds some bytes, even late in a run.
BOUND = 500.0


#: Bytes by which the process may grow in a step, over the last half of a run. It grows by pages of 4 kB,
#: and with the largest matrix pattern so far.
RESIDENT = 500.0


class _Mallinfo(ctypes.Structure):
    """Memory statistics of glibc [bytes]."""

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
    """Growth of the memory in use per step [bytes], over `steps` steps after the `first`."""
    motion = block.spinning(block.scene(form, **options), 2.0)
    start = 0
    for step in range(first + steps):
        if step == first:
            start = in_use()
        motion.step(0.004)
    return max(in_use() - start, 0) / steps


class _Counter(ctypes.Structure):
    """Counters that PETSc attaches to a communicator."""

    _fields_ = [("tag", ctypes.c_int), ("objects", ctypes.c_int)]


#: Represents an unknown number of objects.
HIDDEN = -1


def objects() -> int:
    """Number of PETSc objects on the communicators of all ranks and of this rank.

    HIDDEN if PETSc does not tell (3.25 in Debian sid).
    """
    maps = Path("/proc/self/maps").read_text().splitlines()
    (library,) = {line.split()[-1] for line in maps if "libpetsc" in line}
    try:
        key = ctypes.c_int.in_dll(ctypes.CDLL(library), "Petsc_Counter_keyval").value
    except ValueError:
        return HIDDEN
    count = 0
    for comm in (MPI.COMM_WORLD, MPI.COMM_SELF):
        probe = PETSc.Vec().createMPI((1, PETSc.DETERMINE), comm=comm)
        count += _Counter.from_address(probe.comm.tompi4py().Get_attr(key)).objects - 1
        probe.destroy()
    return int(count)


def resident() -> int:
    """Resident memory of the process [bytes]."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def held(form: str, steps: int) -> tuple[float, str]:
    """Growth of the process per step [bytes] over the last half of a run, by linear regression.

    The block hangs from points and vibrates; at finite strain it spins. Solutions are dropped, and
    so are the records of `run`, about 600 bytes per step.

    Raises:
        RuntimeError: The last half has more open files or PETSc objects than the first half ever had.
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

    def count(_: tawami.Solution) -> None:
        if motion.steps % every == 0:
            gc.collect()
            found.append((resident(), len(os.listdir("/proc/self/fd")), objects()))

    for part in range(every, steps + 1, every):
        motion.run(end=1e-3 * part, dt=1e-3, each=count)
    bytes_held, files, alive = np.array(found).T
    half = len(found) // 2
    for name, counts in (("files", files), ("objects of PETSc", alive)):
        if counts[half:].max() > counts[:half].max():
            raise RuntimeError(f"{name}: {counts[:half].max()}, later {counts[half:].max()}")
    slope = np.polyfit(every * np.arange(half, len(found)), bytes_held[half:], 1)[0]
    counted = "unknown" if alive[-1] == HIDDEN else alive[-1]
    remark = f"{bytes_held[-1] / 2**20:.0f} MB, {files[-1]} files, {counted} objects of PETSc"
    return max(float(slope), 0.0), remark


def scenes(number: int, *, one_grid: bool = False) -> float:
    """Growth of the memory in use per scene [bytes], for scenes that are made, stepped and dropped.

    Each has a grid of its own, or all have the same.
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
    """Many steps of each form and assembly, and many scenes."""
    first, steps = (100, 150) if short else (300, 1000)
    for form in ("u_epsv_finite",) if short else ("u_epsv_finite", "u_bbar_finite"):
        yield attempted(
            SUBJECT, f"{form}, bytes a step, {steps} steps after {first}", BOUND,
            partial(growth, form, first, steps),
        )  # fmt: skip
    if not short:
        yield attempted(
            SUBJECT, "assembly by dolfinx, bytes a step, 300 steps after 200", BOUND,
            partial(growth, "u_epsv_finite", 200, 300, assembly="dolfinx"),
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
