"""The run that a path on the command line names: its folder, or a file or folder in it."""

from __future__ import annotations

import os
from pathlib import Path

from tawami.base import checks
from tawami.base.errors import InputError
from tawami.base.files import nearest
from tawami.base.text import listed, suggestion
from tawami.results.provenance import RUN

EXPECTED = "the folder of a run, as tawami.Results('results/pile', ...) creates it, or a file in it"


def run_folder(given: str) -> Path:
    """The folder of a run.

    Args:
        given: The folder, or a file or folder in it.

    Raises:
        InputError: No run, or several; the message lists them, or suggests one of nearly this name.
    """
    path = checks.path("folder", given)
    if is_run(path):
        return path
    if not os.path.lexists(path):
        raise InputError(f"'{path}' does not exist: expected {EXPECTED}{suggestion(_meant(path))}")
    for parent in Path(os.path.abspath(path)).parents:
        if is_run(parent):
            return parent if path.is_absolute() else Path(os.path.relpath(parent))
    runs = [file.parent for depth in ("*", "*/*") for file in sorted(path.glob(f"{depth}/{RUN}"))]
    if runs:
        one = "a run: expected" if len(runs) == 1 else f"{len(runs)} runs: expected one of"
        raise InputError(f"'{path}' holds {one} {listed([*map(str, runs)])}")
    what = "holds no run" if os.path.isdir(path) else "is not a file of a run"
    raise InputError(f"'{path}' {what}: expected {EXPECTED}{suggestion(_meant(path))}")


def is_run(folder: Path) -> bool:
    """Whether a folder is that of a run."""
    return os.path.lexists(folder / RUN)


def _meant(path: Path) -> Path | None:
    """A run of nearly this name, also in the folder results."""
    usual = Path("results") / path.stem
    return nearest(path, is_run) or (None if path.is_absolute() else nearest(usual, is_run))
