"""Stored runs of studies: one line of JSON for each run, in the folder of the study."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from tawami.base.errors import InputError
from tawami.base.files import append_line, unreadable
from tawami.study.series import Key, setting_text

FILE = "runs.jsonl"


def stored_runs(folder: Path, study: str) -> dict[Key, dict[str, Any]]:
    """Stored runs by label, setting and fingerprint; lines that were cut off are left out.

    Args:
        folder: Of the study.
        study: Its name, for messages.

    Raises:
        InputError: The file cannot be read.
    """
    path, runs = folder / FILE, dict[Key, dict[str, Any]]()
    if not os.path.lexists(path):
        return runs
    problem = unreadable(path)
    if problem is not None:
        raise InputError(
            f"study '{study}': '{path}' cannot be read ({problem}): expected the runs that it "
            "has stored; remove it to start again"
        )
    for line in path.read_text(errors="replace").splitlines():
        try:
            run = json.loads(line)
            runs[run["label"], setting_text(run["knobs"]), run["fingerprint"]] = run
        except (ValueError, TypeError, KeyError):
            continue
    return runs


def store(folder: Path, run: Mapping[str, Any]) -> None:
    """Store a run: its label, knobs, fingerprint and outcome."""
    append_line(folder / FILE, json.dumps(run), sync=True)
