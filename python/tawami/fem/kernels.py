"""Compiled kernels of UFL forms, cached on disk by FFCx."""

from __future__ import annotations

import logging
import platform
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from mpi4py import MPI

from tawami.base import ranks
from tawami.fem import cache
from tawami.fem.dolfinx import OLD, ffcx, jit, version

#: Domains of integrals, in the order of FFCx.
Kind = Literal["cell", "exterior_facet", "interior_facet"]
KINDS: tuple[Kind, ...] = ("cell", "exterior_facet", "interior_facet")
#: Sums may be reordered, so that they vectorise: this saves a fifth of the time. -ffast-math is avoided,
#: because the linker would then switch off denormal numbers in the whole process. Loops that are not
#: peeled completely save a tenth of the time of a tangent.
COMPILER_FLAGS = (
    "-O3", "-march=native", "-g0", "-w", "-fno-math-errno", "-fno-trapping-math",
    "--param=max-completely-peeled-insns=0",
    "-fassociative-math", "-fno-signed-zeros", "-freciprocal-math",
)  # fmt: skip


@contextmanager
def quiet() -> Iterator[None]:
    """Silence the root logger at level INFO, where FFCx reports each build in detail."""
    before = logging.root.manager.disable
    logging.disable(logging.INFO)
    try:
        yield
    finally:
        logging.disable(before)


def settings(comm: Any, subject: Any) -> dict[str, Any]:
    """Settings with which dolfinx loads the compiled code of a form or an element.

    Args:
        comm: Communicator, whose ranks all call this.
        subject: A form or an element of UFL.
    """
    signature = subject.signature() if hasattr(subject, "signature") else repr(subject)
    options = ffcx.get_parameters() if OLD else ffcx.get_options()
    built_by = (version, ffcx.__version__, platform.python_version(), options, COMPILER_FLAGS)
    common = {"cffi_extra_compile_args": list(COMPILER_FLAGS)}

    def compile_into(folder: Path) -> None:
        with quiet():
            jit.ffcx_jit(MPI.COMM_SELF, subject, {}, common | {"cache_dir": folder})

    folder = cache.compiled(comm, f"{signature} {built_by}", compile_into)
    return common | {"cache_dir": folder}


@dataclass(frozen=True)
class Kernel:
    """A compiled integral over cells or facets, not yet attached to a mesh.

    Attributes:
        kind: Domain of the integral.
        address: Address of the C function.
        coefficients: Positions in the form of the coefficients that it reads, in packed order.
        module: Compiled module, which holds the C function.
    """

    kind: Kind
    address: int
    coefficients: tuple[int, ...]
    module: Any


def compile_kernel(comm: Any, form: Any, kind: Kind = "cell") -> Kernel:
    """Compile a UFL form with one kind of integral; the result is cached on disk.

    Raises:
        MissingDependencyError: The compiler failed.
        OutputError: The cache of compiled forms cannot be written.
    """
    options = settings(comm, form)
    with quiet(), ranks.raise_together(comm):
        compiled, module, _ = jit.ffcx_jit(MPI.COMM_SELF, form, {}, options)
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
