"""Number of examples that property tests draw, and whether at random.

`make test` draws the same examples every time. `make fuzz` draws many more, from a seed that it prints.
"""

from __future__ import annotations

import os
import zlib

from hypothesis import settings

#: Set by `make fuzz`.
FUZZ = os.environ.get("HYPOTHESIS_PROFILE") == "fuzz"
#: Examples of `make fuzz` for each of `make test`.
FACTOR = 20


def examples(number: int) -> int:
    """Examples of a test that draws `number` of them in `make test`."""
    return number * FACTOR if FUZZ else number


def seed_of(name: str) -> int:
    """Seed of a test that draws for each of many functions: not the same values for all of them."""
    return zlib.crc32(name.encode()) + int(os.environ.get("SEED", "0"))


def load() -> None:
    """Choose the profile; without a deadline, because the first example may compile a form."""
    settings.register_profile(
        "test", deadline=None, database=None, derandomize=not FUZZ, max_examples=examples(100)
    )
    settings.load_profile("test")
