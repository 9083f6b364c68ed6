"""Checkpoint files: the state of a run in one file, written atomically.

A file is an archive of NumPy (.npz). Each array of the state is stored under its path, as
'scene.particles.stress'; all else is JSON: the state without its arrays, and the identity of the run.
The checksums of the archive detect damage.
"""

from __future__ import annotations

import io
import json
import math
import os
import re
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from tawami.base.errors import CheckpointError
from tawami.base.files import atomic_file, reason

#: Version of the content of a state.
FORMAT = 4
#: Entry of the archive with the JSON.
ABOUT = "about.json"
#: Folder of the checkpoints in the folder of a run.
FOLDER = "checkpoints"


def name_of(number: int, phase: str, steps: int) -> str:
    """Name of the checkpoint of a phase after a number of steps."""
    return f"{number:02d}-{phase}-{steps:08d}.npz"


def files(folder: Path) -> list[Path]:
    """Checkpoints in the folder of a run, in the order of phases and steps."""
    named = (
        (re.fullmatch(r"(\d+)-.*-(\d+)\.npz", p.name), p) for p in (folder / FOLDER).glob("*.npz")
    )
    return [path for _, _, path in sorted((int(m[1]), int(m[2]), path) for m, path in named if m)]


def phase_of(path: Path) -> int:
    """Number of the phase that a checkpoint belongs to."""
    return int(path.name.partition("-")[0])


def steps_of(path: Path) -> int:
    """Number of steps of a checkpoint."""
    return int(path.stem.rpartition("-")[2])


def write(path: Path, identity: Mapping[str, Any], state: Mapping[str, Any]) -> None:
    """Write a state.

    Args:
        path: The file.
        identity: Facts that identify the run, as JSON can hold them.
        state: Dictionaries, lists, numbers, texts and arrays.

    Raises:
        OutputError: The file cannot be written; an older one of that name is kept.
    """
    arrays: dict[str, Any] = {}
    about = {"format": FORMAT, "identity": identity, "state": _pack(state, "", arrays)}
    content = io.BytesIO()  # in memory: NumPy does not close a file whose disk is full
    np.savez(content, **{ABOUT: np.frombuffer(json.dumps(about).encode(), np.uint8)}, **arrays)
    with atomic_file(path) as part, part.open("wb") as file:
        file.write(content.getbuffer())
        file.flush()
        os.fsync(file.fileno())


def read(path: Path) -> tuple[dict[str, Any], dict[str, Any]]:
    """Read a checkpoint.

    Returns:
        The identity of its run, and the state.

    Raises:
        CheckpointError: The file cannot be read, is damaged, or has another format.
    """
    try:
        with zipfile.ZipFile(path) as content:
            damaged = content.testzip()
        if damaged is not None:
            raise ValueError(f"wrong checksum of '{damaged}'")
        with np.load(path, allow_pickle=False) as arrays:
            about = json.loads(arrays[ABOUT].tobytes())
            found, identity = about["format"], about["identity"]
            state = _unpack(about["state"], arrays) if found == FORMAT else {}
    except Exception as error:
        raise CheckpointError(
            f"checkpoint '{path}' cannot be read ({reason(error)}): it is damaged, or is not a "
            "checkpoint of tawami"
        ) from None
    if found != FORMAT:
        raise CheckpointError(
            f"checkpoint '{path}' has format {found!r}: this version of tawami reads format {FORMAT}"
        )
    return identity, state


def particles(path: Path) -> tuple[dict[str, Any], dict[str, Any]]:
    """Identity of a checkpoint, and arrays of its particles by name, each particles x components.

    Raises:
        CheckpointError: As :func:`read`, or its content is not that of a checkpoint.
    """
    identity, state = read(path)
    try:
        arrays: dict[str, Any] = state["scene"]["particles"]
        check_particles(arrays)
    except (LookupError, TypeError, ValueError) as error:
        raise unusable(path, error) from error
    return identity, arrays


def unusable(path: Path | None, error: Exception) -> CheckpointError:
    """A checkpoint whose checksums are right and whose content is not."""
    what = f"{error} is missing" if isinstance(error, KeyError) else reason(error)
    return CheckpointError(
        f"checkpoint '{path}' cannot be used ({what}): its content is not that of a checkpoint. Remove "
        "it to resume from the one before it, or start a new run with existing='replace'"
    )


def check_particles(arrays: Any) -> None:
    """Check the arrays of the particles in a state, each particles x components.

    Raises:
        ValueError: They are not such arrays, or not finite; numbers that repeat, volumes that are not
            positive.
    """
    if not isinstance(arrays, Mapping) or not {"x", "number", "volume"} <= set(arrays):
        raise ValueError("it has no positions, numbers and volumes of particles")
    rows = {getattr(array, "shape", (None,))[:1] for array in arrays.values()}
    for name, array in arrays.items():
        check_like(array, np.zeros((1, *np.shape(array)[1:])), f"'{name}' of the particles")
        if np.ndim(array) != 2 or len(rows) != 1:
            raise ValueError(f"'{name}' of the particles has the shape {np.shape(array)}")
    number = arrays["number"]
    if (
        (number != np.floor(number)).any()
        or (number < 0).any()
        or len(np.unique(number)) != number.size
    ):
        raise ValueError("numbers of the particles are not whole, negative, or repeat")
    if (arrays["volume"] <= 0).any():
        raise ValueError("volumes of the particles are not positive")


def check_like(found: Any, own: Any, name: str) -> None:
    """Check a stored value against one of the same kind: type, columns of an array, finite numbers.

    The number of rows, and parts for which `own` is None, an empty list or dictionary, are not checked.

    Args:
        found: The stored value.
        own: The value that the program has now.
        name: Of the value in the message.

    Raises:
        ValueError: Another kind of value; the message names it.
    """
    if isinstance(own, np.ndarray):
        same = isinstance(found, np.ndarray) and found.dtype == own.dtype
        if not same or found.shape[1:] != own.shape[1:] or found.ndim != own.ndim:
            shown = f"{found.dtype} {found.shape}" if isinstance(found, np.ndarray) else repr(found)
            raise ValueError(f"{name} is {shown[:60]}, expected {own.dtype} {own.shape}")
        if own.size and np.isfinite(own).all() and not np.isfinite(found).all():
            raise ValueError(f"{name} is not finite")
    elif isinstance(own, Mapping):
        if not isinstance(found, Mapping) or (own and found.keys() != own.keys()):
            raise ValueError(f"{name or 'the state'} lacks entries, expected {', '.join(own)}")
        for key, value in own.items():
            if key == "factor" and isinstance(found[key], str):
                continue  # a number that became a function
            check_like(found[key], value, f"{name}.{key}" if name else key)
    elif isinstance(own, list | tuple):
        if found is not None and not isinstance(found, list):
            raise ValueError(f"{name} is {str(found)[:60]!r}, expected a list")
        if found is not None and len(found) == len(own):
            for k, value in enumerate(own):
                check_like(found[k], value, f"{name}[{k}]")
    elif isinstance(own, bool | str) or own is None:
        if own is not None and not isinstance(found, type(own)):
            raise ValueError(f"{name} is {str(found)[:60]!r}, expected a {type(own).__name__}")
    elif isinstance(found, bool) or not isinstance(found, int | float):
        raise ValueError(f"{name} is {str(found)[:60]!r}, expected a number")
    elif math.isfinite(own) and not math.isfinite(found):
        raise ValueError(f"{name} is {found}, expected a finite number")


def _pack(value: Any, path: str, arrays: dict[str, Any]) -> Any:
    """The value as JSON can hold it; its arrays are added to `arrays`."""
    if isinstance(value, np.ndarray):
        arrays[path] = value
        return {"array": path}
    if isinstance(value, Mapping):
        return {
            "items": {
                name: _pack(item, f"{path}.{name}" if path else name, arrays)
                for name, item in value.items()
            }
        }
    if isinstance(value, list | tuple):
        return [_pack(item, f"{path}.{k}", arrays) for k, item in enumerate(value)]
    return value.item() if isinstance(value, np.generic) else value


def _unpack(value: Any, arrays: Mapping[str, Any]) -> Any:
    """The reverse of :func:`_pack`."""
    if isinstance(value, list):
        return [_unpack(item, arrays) for item in value]
    if not isinstance(value, dict):
        return value
    if "array" in value:
        return arrays[value["array"]]
    return {name: _unpack(item, arrays) for name, item in value["items"].items()}
