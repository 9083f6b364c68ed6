"""Identity of a phase of a run: a checkpoint is used only where it is equal."""

from __future__ import annotations

import json
from typing import Any

from tawami.motion.observer import Subject


def identity(subject: Subject, phase: str) -> dict[str, Any]:
    """Facts that decide the result of a phase, as they are read back from JSON; a call for all ranks."""
    facts: dict[str, Any] = json.loads(json.dumps({"phase": phase} | subject.identity()))
    return facts
