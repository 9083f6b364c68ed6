"""Stand-in until merged."""

import json
from typing import Any


def write(folder: Any, scene: object, motion: object) -> None:
    """Stand-in."""
    (folder / "run.json").write_text(json.dumps({"phases": {}}))
