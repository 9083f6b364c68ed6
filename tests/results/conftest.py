"""Runs that tests of results begin with, and the log that the other tests silence."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from pathlib import Path

import pytest
from runs import Kill, Killed, results_of, run


@pytest.fixture
def interrupted(tmp_path: Path) -> Path:
    """The folder of a run killed in its eighth step, with checkpoints of the fourth and the sixth."""
    with pytest.raises(Killed):
        run(tmp_path / "run", each=Kill(8))
    names = [path.name for path in results_of(tmp_path / "run").checkpoints]
    assert names == ["01-motion-00000004.npz", "01-motion-00000006.npz"]
    return tmp_path / "run"


@pytest.fixture
def log_on() -> Iterator[None]:
    """Messages of level INFO, which the tests otherwise switch off."""
    logging.disable(logging.NOTSET)
    yield
    logging.disable(logging.INFO)
