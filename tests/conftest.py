"""Settings of a test session, and the fixtures that several test files use."""

from __future__ import annotations

import logging
import os
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

# Kernels are cached in this checkout, here and in the programs that tests start: they depend neither on
# what other checkouts left behind nor on what they are compiling now. Before dolfinx is imported.
CACHE = Path(__file__).parents[1] / ".pytest_cache" / "xdg"
os.environ["XDG_CACHE_HOME"] = str(CACHE)

# Each process of pytest-xdist ("gw0", "gw1", ...) has a processor, which its programs share. Where ranks
# have several, one that waits for a message gives its time to another test, for a time slice each time.
PROCESSORS = sorted(os.sched_getaffinity(0))
if (worker := os.environ.get("PYTEST_XDIST_WORKER")) is not None:
    os.sched_setaffinity(0, {PROCESSORS[int(worker.removeprefix("gw")) % len(PROCESSORS)]})

import profiles  # noqa: E402
import pytest  # noqa: E402
import scenes  # noqa: E402

import tawami  # noqa: E402

# A shell that starts pytest in the background ignores Ctrl-C for it and for the processes of its tests.
signal.signal(signal.SIGINT, signal.default_int_handler)
logging.disable(logging.INFO)  # FFCx reports every form that it compiles
profiles.load()


def pytest_addoption(parser: pytest.Parser) -> None:
    """The switch `--linear-solver NAME`: the solver of all scenes that do not name one."""
    parser.addoption("--linear-solver", choices=("auto", "direct", "multigrid"))


def pytest_configure(config: pytest.Config) -> None:
    """Let the factorisation take over where multigrid stalls."""
    if config.getoption("--linear-solver") is not None:
        config.addinivalue_line("filterwarnings", "default::tawami.SolverWarning")


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Set that solver before the fixtures are made, and the one by default in tests of it."""
    named = item.config.getoption("--linear-solver") or "auto"
    own = item.get_closest_marker("direct") is not None
    tawami.Scene.__init__.__kwdefaults__["linear_solver"] = "auto" if own else named


@pytest.fixture(params=scenes.FORMS)
def form(request: pytest.FixtureRequest) -> dict[str, Any]:
    """Options of each shipped form of small strain, with each of its stabilisations."""
    return scenes.FORMS[request.param]


@pytest.fixture(params=scenes.FINITE)
def finite(request: pytest.FixtureRequest) -> dict[str, Any]:
    """Options of each shipped form of finite strain."""
    return scenes.FINITE[request.param]


@pytest.fixture(params=scenes.BASES)
def basis(request: pytest.FixtureRequest) -> str:
    """Each basis of the displacement."""
    return str(request.param)


@pytest.fixture
def random_scene() -> Callable[..., tawami.Scene]:
    """`scenes.random_scene`."""
    return scenes.random_scene
