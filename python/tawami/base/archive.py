"""Checkpoints: the state of a run in one file, which is there whole or not at all.

A file is an archive of NumPy (.npz): each array of the state under its path ('scene.particles.stress'),
the rest of it, and what the run is (`identity`), as JSON. The archive's checksums tell a damaged file.
"""

from __future__ import annotations

import io
import json
import os
import re
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from tawami.base.errors import CheckpointError
from tawami.base.files import whole_file
from tawami.base.identity import same

#: Changes with what a state holds.
FORMAT = 2
ABOUT = "about.json"
#: In the folder of results.
FOLDER = "checkpoints"


def files(folder: Path) -> list[Path]:
    """The checkpoints of a folder of results, oldest first: in the order of phases, then of steps."""
    named = (
        (re.fullmatch(r"(\d+)-.*-(\d+)\.npz", p.name), p) for p in (folder / FOLDER).glob("*.npz")
    )
    return [path for _, _, path in sorted((int(m[1]), int(m[2]), path) for m, path in named if m)]


def phase_of(path: Path) -> int:
    """Number of the phase that a checkpoint belongs to."""
    return int(path.name.partition("-")[0])


def write(path: Path, identity: Mapping[str, Any], state: Mapping[str, Any]) -> None:
    """Write a state.

    Args:
        path: The file.
        identity: What the run is, as JSON can hold it: `read` compares it.
        state: Dictionaries, lists, numbers, texts and arrays.

    Raises:
        OutputError: It cannot be written; what was there before still is.
    """
    arrays: dict[str, Any] = {}
    about = {"format": FORMAT, "identity": identity, "state": _packed(state, "", arrays)}
    archive = io.BytesIO()  # NumPy leaves an archive open that it cannot write to the end
    np.savez(archive, **{ABOUT: np.frombuffer(json.dumps(about).encode(), np.uint8)}, **arrays)
    with whole_file(path) as part, part.open("wb") as file:
        file.write(archive.getbuffer())
        file.flush()
        os.fsync(file.fileno())


def read(path: Path, identity: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """The state in a file.

    Args:
        path: The file.
        identity: What the run is that asks; None for whoever only looks.

    Raises:
        CheckpointError: It cannot be read, is damaged, or is of another run.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            damaged = archive.testzip()
        if damaged is not None:
            raise ValueError(f"wrong checksum of '{damaged}'")
        with np.load(path, allow_pickle=False) as arrays:
            about = json.loads(arrays[ABOUT].tobytes())
            found, written = about["format"], about["identity"]
            state = _unpacked(about["state"], arrays) if found == FORMAT else {}
    except Exception as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise CheckpointError(
            f"checkpoint '{path}' cannot be read ({reason}): it is damaged or not one of tawami's"
        ) from None
    if found != FORMAT:
        raise CheckpointError(
            f"checkpoint '{path}' has format {found!r}: this version of tawami reads format {FORMAT}"
        )
    for name, own in (identity or {}).items():
        other = written.get(name)
        if not same(other, own):
            raise CheckpointError(
                f"checkpoint '{path}' is of another run: {name} {_short(other)} there, {_short(own)} "
                "here. Expected the same scene; start anew with existing='replace'"
            )
    result: dict[str, Any] = state
    return result


def _packed(value: Any, path: str, arrays: dict[str, Any]) -> Any:
    """The value as JSON can hold it, its arrays apart."""
    if isinstance(value, np.ndarray):
        arrays[path] = value
        return {"array": path}
    if isinstance(value, Mapping):
        return {
            "items": {
                name: _packed(item, f"{path}.{name}" if path else name, arrays)
                for name, item in value.items()
            }
        }
    if isinstance(value, list | tuple):
        return [_packed(item, f"{path}.{k}", arrays) for k, item in enumerate(value)]
    return value.item() if isinstance(value, np.generic) else value


def _unpacked(value: Any, arrays: Mapping[str, Any]) -> Any:
    if isinstance(value, list):
        return [_unpacked(item, arrays) for item in value]
    if not isinstance(value, dict):
        return value
    if "array" in value:
        return arrays[value["array"]]
    return {name: _unpacked(item, arrays) for name, item in value["items"].items()}


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
