"""Stand-in until merged."""

import json


def write(folder: object, scene: object, motion: object) -> None:
    """Stand-in."""
    (folder / "run.json").write_text(json.dumps({"phases": {}}))
