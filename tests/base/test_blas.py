"""OpenBLAS on a processor that it does not know: the kernels are replaced if this is safe."""

from __future__ import annotations

import ctypes
import os
import signal

import pytest

from tawami.base import blas

FLAGS = {
    "SkylakeX": "fpu sse2 avx avx2 fma avx512f avx512dq avx512cd avx512bw avx512vl",
    "Haswell": "fpu sse2 avx avx2 fma",
    "": "fpu sse2 avx",
}


def core(library):
    library.openblas_get_corename.restype = ctypes.c_char_p
    return library.openblas_get_corename().decode()


@pytest.fixture
def unknown(monkeypatch):
    """The loaded OpenBLAS as if it did not know this processor."""
    try:
        library = ctypes.CDLL(blas.LIBRARY)
        name = core(library)
    except (OSError, AttributeError):
        pytest.skip("the BLAS is not OpenBLAS")
    monkeypatch.delenv(blas.VARIABLE, raising=False)
    if not hasattr(library, "gotoblas_dynamic_init") or not blas.suitable("Prescott"):
        pytest.skip("OpenBLAS with one set of kernels, or a processor without AVX2")
    blas._initialise(library, "Prescott")
    assert core(library) == "Prescott"
    yield library
    blas._initialise(library, name)
    assert core(library) == name


def test_fallback_kernels_are_replaced(unknown):
    wanted = blas.suitable("Prescott")
    assert blas.choose() == blas.Core(wanted, instead_of="Prescott")
    assert core(unknown) == wanted
    assert blas.VARIABLE not in os.environ
    assert blas.multiplies(unknown)
    assert blas.choose() == blas.Core(wanted)  # they are not a fallback


def test_kernels_that_fail_their_trial_are_not_used(unknown, monkeypatch):
    """Wrong products, an instruction that does not exist, and a call that does not return."""
    failures = (
        lambda library: False,
        lambda library: os.kill(os.getpid(), signal.SIGKILL),
        lambda library: signal.pause(),
    )
    monkeypatch.setattr(blas, "TRIAL", 0.2)
    for failure in failures:
        monkeypatch.setattr(blas, "multiplies", failure)
        found = blas.choose()
        assert (found.name, found.instead_of, core(unknown)) == ("Prescott", "", "Prescott")
        assert "install a newer OpenBLAS" in found.advice


def test_a_core_type_of_the_environment_is_kept(unknown, monkeypatch):
    monkeypatch.setenv(blas.VARIABLE, "Prescott")
    assert blas.choose() == blas.Core("Prescott")
    assert os.environ[blas.VARIABLE] == "Prescott"


def test_wrong_products_are_noticed(unknown):
    class Wrong:
        def __init__(self, name):
            self._name = name

        def __getattr__(self, name):
            if name == self._name:
                return lambda *arguments: None
            return getattr(unknown, name)

    assert blas.multiplies(unknown)
    assert not any(map(blas.multiplies, map(Wrong, ("dgemm_", "dgemv_", "dtrsm_"))))


@pytest.mark.parametrize("expected", FLAGS)
def test_the_processor_has_the_instructions_of_the_chosen_kernels(expected, monkeypatch, tmp_path):
    monkeypatch.delenv(blas.VARIABLE, raising=False)
    processors = tmp_path / "cpuinfo"
    processors.write_text(f"processor\t: 0\nflags\t\t: {FLAGS[expected]}\n")
    monkeypatch.setattr(blas, "PROCESSORS", processors)
    assert blas.suitable("Prescott") == expected
    assert blas.suitable("SkylakeX") == blas.suitable("Zen") == ""


def test_other_architectures_systems_and_libraries_are_left_alone(monkeypatch, tmp_path):
    monkeypatch.delenv(blas.VARIABLE, raising=False)
    processors = tmp_path / "cpuinfo"
    monkeypatch.setattr(blas, "PROCESSORS", processors)
    assert blas.suitable("Generic") == ""  # no such file
    processors.write_text("processor\t: 0\nFeatures\t: fp asimd sve2\n")
    assert blas.suitable("Generic") == ""
    for library in ("libdoesnotexist.so.7", "libm.so.6"):
        monkeypatch.setattr(blas, "LIBRARY", library)
        assert blas.choose() == blas.Core()
