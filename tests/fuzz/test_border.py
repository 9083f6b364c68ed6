"""The border of the compiled module: any argument works, or raises an error that a driver can catch.

A panic of Rust reaches Python as pyo3's PanicException, which is no `Exception` and passes every
`except Exception`. A test fails on one.
"""

from __future__ import annotations

import gc
import os
import subprocess
import sys
import threading
import warnings
from collections.abc import Callable
from time import perf_counter, sleep
from typing import Any

import numpy as np
import pytest
from border_calls import BASIS, CALLS, FIELDS, NODES, TERMS, N, Sample
from hypothesis import given, seed, settings
from hypothesis import strategies as st
from profiles import examples, seed_of
from scenes import grid_of

import tawami
from tawami import _rust

SHAPES = st.sampled_from(
    [(), (0,), (1,), (N,), (N + 1,), (4 * N,), (0, 2), (2, N), (N, 0), (N, 1), (N, 2), (N, 3), (N, 4),
     (N, 4, 4), (30,), (60,), (80,)]
)  # fmt: skip
DTYPES = st.sampled_from(
    ["f8", ">f8", "f4", "f2", "u4", "i4", "i8", "u8", "i1", "?", "c16", "O", "U3", "S3", "M8[s]",
     [("a", "i1"), ("b", "f8")]]
)  # fmt: skip
NUMBERS = st.sampled_from(
    [0, 1, 2, -1, -(2**31), 2**31, 2**32, 2**63 - 1, 2**63, 2**64 - 1, 2**64, 2**200, 10**6, 1000, 5,
     0.5, -0.0, np.nan, np.inf, -np.inf, 5e-324, 1e308]
)  # fmt: skip


@st.composite
def arrays(draw: st.DrawFn) -> Any:
    """An array of some shape, type, order and content."""
    shape, kind = draw(SHAPES), draw(DTYPES)
    values = np.zeros(shape, dtype=kind)
    if values.dtype.kind in "fui" and values.size:
        with np.errstate(all="ignore"):
            number = draw(NUMBERS)
            if values.dtype.kind == "f":
                values[...] = float(number)
            elif number == number and abs(number) != np.inf:
                values[...] = int(number) % 2**31 % (np.iinfo(values.dtype).max + 1)
    how = draw(st.sampled_from(["as it is", "Fortran", "reversed", "every other", "read-only", "masked",
                                "unaligned", "transposed", "broadcast"]))  # fmt: skip
    match how:
        case "Fortran":
            return np.asfortranarray(values)
        case "reversed":
            return np.flip(values)
        case "every other":
            return np.repeat(values, 2, axis=0)[::2] if values.ndim else values
        case "read-only":
            values.setflags(write=False)
        case "masked":
            return np.ma.masked_array(values)
        case "unaligned":
            padded = np.zeros(values.shape, dtype=[("a", "i1"), ("b", values.dtype)])
            return padded["b"]
        case "transposed":
            return values.T
        case "broadcast":
            return np.broadcast_to(values, (2, *values.shape))
    return values


NASTY = st.one_of(
    arrays(),
    NUMBERS,
    st.sampled_from(
        [None, True, "", BASIS, "bilinear", "biquadratic", "mixed", "cell", "x\ud800", b"x", 1j, [], (),
         {}, [[0]], [(0, 0)],
         [(9, 9)], [(0, 2**63)], [[(0, 0, 0)]], [1, -1], [0] * 9, [(0,)], {1}, range(3),
         object(), [None], [(None, 0, 1, 0, [], [])], [(None, 1, 7, 0, [], [])], ["sigma"],
         [[("sigma", "value", 0, None)]], [[("sigma", "value", 2**64 - 1, None)]],
         [[("ln_J", "strain", 1, None)]], [[("sigma", "value", 0, np.ones(N + 1))]],
         [[("ln_J", "value", 0, None), ("s", "value", 1, None)]], [[], []],
         [[("no", "value", 0, None)]], [[("sigma", "no", 0, None)]]]
    ),
    st.lists(st.integers(-1, 2**33), max_size=4),
)  # fmt: skip


def called(function: Callable[..., Any], *arguments: Any) -> None:
    """Call, and let pass what a driver can catch. pyo3 raises OverflowError for whole numbers that are
    too large for a machine word.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # NumPy's, of arrays as numbers
        try:
            function(*arguments)
        except (tawami.TawamiError, TypeError, ValueError, OverflowError):
            pass
        except RuntimeError as error:
            assert str(error).startswith("internal: "), error


@pytest.mark.fuzz
@pytest.mark.parametrize("name", CALLS)
def test_any_argument_works_or_raises(name):
    function, *arguments = CALLS[name](Sample())
    function(*arguments)  # the good ones are good

    @seed(seed_of(name))
    @settings(max_examples=examples(40))
    @given(st.integers(0, len(arguments) - 1), NASTY, st.booleans())
    def replaced(which: int, value: Any, part: bool) -> None:
        function, *arguments = CALLS[name](Sample())
        if part and isinstance(arguments[which], tuple):  # one of several in one argument
            value = (*arguments[which][:-1], value)
        arguments[which] = value
        called(function, *arguments)

    replaced()


@given(
    st.lists(st.integers(0, 4), min_size=80, max_size=80),
    st.integers(0, 80),
    st.integers(0, 2**31 - 1),
)
def test_any_selection_has_a_pattern_or_is_rejected(counts, unknowns, seed):
    """Rows with these numbers of entries, of unknowns that are any of the coefficients."""
    s, random = Sample(), np.random.default_rng(seed)
    start = np.cumsum([0, *counts]).astype(np.int32)
    unknown = random.integers(0, max(unknowns, 1) + (seed % 3 == 0), start[-1]).astype(np.int32)
    coefficient = random.integers(0, 80 + (seed % 5 == 0), unknowns)
    try:
        pattern = s.assembler.pattern((start, unknown, np.ones(start[-1]), coefficient))
    except RuntimeError as error:
        assert str(error).startswith("internal: not a selection")
        assert unknown.max(initial=0) >= unknowns or coefficient.max(initial=0) >= 80
    else:
        assert len(pattern.start) == unknowns + 1
        assert (pattern.columns < unknowns).all()
        values = np.zeros(len(pattern.columns))
        called(s.assembler.matrix, s.none[1], s.none[0], [], s.volume, s.all, pattern, values)


def test_every_function_and_method_is_in_the_table():
    """All of them that take arguments."""
    without = {"check", "rows", "add_eps_v", "elastic_energy", "parameters", "__version__",
               "MAX_COEFFICIENTS"}  # fmt: skip
    there = set()
    for name in _rust.__all__:
        entry = getattr(_rust, name)
        if isinstance(entry, type) and not issubclass(entry, Exception):
            if name not in ("Location", "Material", "Pattern"):  # no constructor
                there.add(name)
            there |= {
                f"{name}.{method}"
                for method in vars(entry)
                if not method.startswith("_")
                and method not in without
                and callable(getattr(entry, method))
            }
        elif not isinstance(entry, type) and name not in without:
            there.add(name)
    assert there == set(CALLS)


def test_an_array_that_cannot_be_written_raises_an_error():
    s = Sample()
    s.data.setflags(write=False)
    with pytest.raises(TypeError, match="not writeable"):
        s.stage.evaluate(s.u, s.v, s.requests, [s.data])
    with pytest.raises(TypeError, match="row by row"):
        s.stage.evaluate(s.u, s.v, s.requests, [np.zeros((N, 4), order="F")])
    with pytest.raises(TypeError, match="already borrowed"):  # read and written at once
        s.assembler.matrix(s.none[1], s.none[0], [], s.volume, s.values[:80], s.pattern, s.values)


def test_positions_may_be_a_view_of_those_of_the_particles():
    s = Sample()
    s.particles.move_to(s.particles.x)
    np.testing.assert_array_equal(s.particles.x, s.x)
    s.particles.move_to(s.particles.x[::-1])
    np.testing.assert_array_equal(s.particles.x, s.x[::-1])


def test_the_stress_of_a_law_may_be_a_view_of_that_of_the_particles():
    s = Sample()
    s.particles.stress[:] = np.arange(4.0 * N).reshape(N, 4)
    s.stage.commit(s.u, s.v, (s.particles.stress.ravel(), *s.given[1:]))
    np.testing.assert_allclose(s.particles.stress.ravel(), np.arange(4.0 * N), atol=1e-12)


def test_objects_of_other_particles_or_of_another_grid_raise_an_error():
    s = Sample()
    few, elsewhere = s.location.select(s.few), _rust.Grid((-1, 0), 9.0, (2, 2)).locate(s.x)
    other = _rust.Assembler(few, FIELDS, NODES, TERMS)
    pattern = other.pattern(s.selection)
    plain = _rust.Particles(s.x, s.volume, s.material)
    for call, message in (
        (lambda: _rust.Stage(s.particles, few, [s.law], "mixed", False, BASIS), "other particles"),
        (lambda: _rust.nodal_sums(few, s.volume, s.data, BASIS), "particle data"),
        (
            lambda: _rust.Stage(s.particles, s.location, [], "mixed", False, BASIS),
            "other materials",
        ),
        (
            lambda: s.assembler.matrix(
                s.none[1], s.none[0], [], s.volume, s.all, pattern, s.values
            ),
            "another pattern",
        ),
        (lambda: s.assembler.vector(s.none[1], [], s.volume, s.all), "another rank"),
        (lambda: s.stage.evaluate(s.u, s.v, s.requests, [s.data, s.packed]), "other arrays"),
        (lambda: s.stage.evaluate(s.u, s.v, s.requests, [np.zeros((N, 3))]), "reaches outside"),
        (lambda: s.particles.of_rows(plain.rows()), "rows of other"),
        (lambda: _rust.interpolate(elsewhere, BASIS, 2, s.u), "wrong number of grid"),
    ):
        with pytest.raises(RuntimeError, match=f"internal: .*{message}"):
            call()


def test_a_call_that_reads_particles_while_they_change_raises_an_error():
    s = Sample()

    class Width:
        def __index__(self) -> int:
            return s.particles.x.shape[1]

    with pytest.raises(RuntimeError, match="borrowed"):
        s.particles.carry("acceleration", Width())


def test_other_threads_of_python_run_during_a_long_call():
    grid = _rust.Grid((0.0, 0.0), 1.0, (300, 300))
    x = np.random.default_rng(0).random((300_000, 2)) * 300
    location = grid.locate(x)
    ones, seen, running = np.ones(len(x)), [], True

    def watch() -> None:
        while running:
            seen.append(perf_counter())
            sleep(1e-3)

    watcher = threading.Thread(target=watch)
    watcher.start()
    try:
        start = perf_counter()
        _rust.nodal_sums(location, ones, np.ones((len(x), 12)), BASIS)
        end = perf_counter()
    finally:
        running = False
        watcher.join()
    assert any(start < time < end for time in seen)


@pytest.mark.parametrize("threads", ["1", "2"])
def test_every_thread_of_python_computes_without_waiting_for_the_first(threads):
    code = """
import threading
import numpy as np
from tawami import _rust
grid = _rust.Grid((0.0, 0.0), 1.0, (9, 9))
location = grid.locate(np.random.default_rng(0).random((500, 2)) * 9)
sums = lambda: _rust.nodal_sums(location, np.ones(500), np.ones((500, 2)), "bilinear")
found = [sums()]
others = [threading.Thread(target=lambda: found.append(sums())) for _ in range(3)]
for other in others: other.start()
for other in others: other.join()
print(len(found), len({array.tobytes() for array in found}))
"""
    run = subprocess.run(
        [sys.executable, "-c", code], env=os.environ | {"RAYON_NUM_THREADS": threads},
        capture_output=True, text=True, check=True, timeout=60,
    )  # fmt: skip
    assert run.stdout.split()[-2:] == ["4", "1"]


def test_a_view_stays_readable_when_the_storage_is_replaced():
    """Particles that leave the grid make a new storage; a view holds the old one."""
    grid = grid_of((6, 2))
    body = tawami.box(grid, (1.0, 0.5), (2.0, 1.5), per_axis=2)
    scene = tawami.Scene(
        grid, body, tawami.linear_elastic(E=1e3, nu=0.3), form="u_finite", density=1.0,
        leaving="remove",
    )  # fmt: skip
    motion = tawami.Dynamics(scene, velocity=(1.0, 0.0))
    views = {"x": scene.particles.x, "stress": scene.particles.stress, "velocity": motion.velocity}
    before = len(scene.particles)
    for _ in range(4):
        motion.step(0.1)
    assert 0 < len(scene.particles) < before
    kept = {name: view.copy() for name, view in views.items()}
    del scene, motion
    gc.collect()
    _ = [np.full((before, 4), 7.0) for _ in range(100)]  # uses memory that was freed
    for name, view in views.items():
        assert len(view) == before
        np.testing.assert_array_equal(view, kept[name])
    assert views["x"].max() <= 2.0 + 0.1
