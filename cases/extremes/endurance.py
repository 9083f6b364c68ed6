"""A long run of a small scene: memory that the process has taken and not given back.

Measured with the C library's own count of what is in use (mallinfo2, glibc), after the first steps have
filled the caches of Python, PETSc, MUMPS and of the C library.
"""

from __future__ import annotations

import ctypes
import gc
from collections.abc import Iterator
from functools import partial
from typing import Any

import tawami
from cases.extremes import block
from cases.extremes.attempt import Attempt, attempted

SUBJECT = "endurance"
#: Bytes that a step may leave behind: a leaked vector of the grid has 5 kB, the smallest object of
#: PETSc 1 kB. Patterns of the matrix that are larger than all before make it grow a little, late too.
BOUND = 500.0


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


def scenes(number: int) -> float:
    """Bytes a scene that are in use after so many were made, stepped and dropped."""

    def once() -> None:
        tawami.Dynamics(block.scene()).step(0.004)

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
    number = 20 if short else 50
    yield attempted(SUBJECT, f"bytes a scene, {number} scenes", BOUND, partial(scenes, number))
