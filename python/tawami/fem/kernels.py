"""Compiled kernels of UFL forms, cached on disk by FFCx."""

from __future__ import annotations

import functools
import hashlib
import logging
import platform
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from tawami.fem.dolfinx import OLD, jit

#: What an integral goes over, in the order of FFCx.
Kind = Literal["cell", "exterior_facet", "interior_facet"]
KINDS: tuple[Kind, ...] = ("cell", "exterior_facet", "interior_facet")
#: Sums may be reordered, so that they vectorise: this saves a fifth of the time. -ffast-math is avoided,
#: because the linker would then switch off denormal numbers in the whole process.
COMPILER_FLAGS = (
    "-O3", "-march=native", "-g0", "-w", "-fno-math-errno", "-fno-trapping-math",
    "-fassociative-math", "-fno-signed-zeros", "-freciprocal-math",
)  # fmt: skip


@functools.cache
def cache_directory() -> Path:
    """Directory of compiled kernels; each kind of processor has its own."""
    try:
        flags = next(s for s in Path("/proc/cpuinfo").read_text().splitlines() if "flags" in s)
    except (OSError, StopIteration):
        flags = platform.processor()
    default = jit.get_options()["cache_dir"] if not OLD else jit.get_parameters()["cache_dir"]
    return Path(default) / f"tawami-{hashlib.sha1(flags.encode()).hexdigest()[:10]}"


@contextmanager
def quiet() -> Iterator[None]:
    """Silence the root logger at level INFO, where FFCx reports each build in detail."""
    before = logging.root.manager.disable
    logging.disable(logging.INFO)
    try:
        yield
    finally:
        logging.disable(before)


@dataclass(frozen=True)
class Kernel:
    """A compiled integral over cells or facets, not yet attached to a mesh.

    Attributes:
        kind: What it integrates over.
        address: Address of the C function.
        coefficients: Positions in the form of the coefficients that it reads, in packed order.
        module: Compiled module, which holds the C function.
    """

    kind: Kind
    address: int
    coefficients: tuple[int, ...]
    module: Any


#: How long to wait for a kernel that another process compiles [s]. FFCx would raise an error after 10 s,
#: which is too short on a busy machine.
PATIENCE = 60


def compile_kernel(comm: Any, form: Any, kind: Kind = "cell") -> Kernel:
    """Compile a UFL form with one kind of integral; the result is cached on disk."""
    settings = {
        "cffi_extra_compile_args": list(COMPILER_FLAGS),
        "cache_dir": cache_directory(),
        "timeout": PATIENCE,
    }
    with quiet():
        compiled, module, _ = jit.ffcx_jit(comm, form, {}, settings)
    place = KINDS.index(kind)
    if OLD:
        integral = compiled.integrals(place)[0]
        order = compiled.original_coefficient_position
    else:
        integral = compiled.form_integrals[compiled.form_integral_offsets[place]]
        order = compiled.original_coefficient_positions
    address = int(module.ffi.cast("uintptr_t", integral.tabulate_tensor_float64))
    used = tuple(order[i] for i in range(compiled.num_coefficients))
    return Kernel(kind, address, used, module)
