"""Checkpoint files: the state of a run in one file, written atomically.

A file is an archive of NumPy (.npz). Each array of the state is stored under its path, as
'scene.particles.stress'; all else is JSON: the state without its arrays, and the identity of the run.
The checksums of the archive detect damage. Each rank writes and reads its own rows of the arrays of
particles and of the grid, in the order of their numbers, and verifies a part of the checksums. Only the
cells of each rank depend on the number of ranks.
"""

from __future__ import annotations

import io
import json
import math
import os
import re
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from tawami.base import ranks, shared_file
from tawami.base.entries import Entries
from tawami.base.errors import CheckpointError
from tawami.base.files import reason
from tawami.base.ranks import raise_together
from tawami.base.shared_file import Rows, crc_of

#: Version of the content of a state.
FORMAT = 7
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


def write(
    path: Path, identity: Mapping[str, Any], state: Mapping[str, Any], comm: Any = MPI.COMM_SELF
) -> None:
    """Write a state; a call for all ranks, each of which writes its own rows.

    Args:
        path: The file.
        identity: Facts that identify the run, as JSON can hold them.
        state: Dictionaries, lists, numbers, texts, arrays that all ranks have, and `Rows` of arrays.
        comm: Communicator.

    Raises:
        OutputError: The file cannot be written; an older one of that name is kept.
    """
    arrays: dict[str, Any] = {}
    about = {"format": FORMAT, "identity": identity, "state": _pack(state, "", arrays)}
    # sums of ranks may differ in their last digits, and so may the length of the text
    text = ranks.same(comm, json.dumps(about))
    content = {ABOUT: np.frombuffer(text.encode(), np.uint8), **arrays}
    pieces, entries, place = list[tuple[int, Any]](), list[zipfile.ZipInfo](), 0
    for name, array in content.items():
        rows = array if isinstance(array, Rows) else Rows.of_first_rank(comm, array)
        own = np.ascontiguousarray(rows.own).reshape(-1).view(np.uint8).data
        head = _head(rows)
        entry = zipfile.ZipInfo(f"{name}.npy")
        entry.CRC, entry.header_offset = crc_of(comm, head, own), place
        entry.file_size = entry.compress_size = len(head) + rows.row_bytes * rows.total
        start = entry.FileHeader(zip64=True) + head
        pieces.append((place + len(start) + rows.row_bytes * rows.first, own))
        if comm.rank == 0:
            pieces.append((place, start))
        place += len(start) - len(head) + entry.file_size
        entries.append(entry)

    def finish(part: Path) -> None:
        with part.open("r+b") as file:
            with zipfile.ZipFile(file, "w") as directory:
                directory.filelist, directory.start_dir = entries, place
            file.flush()
            os.fsync(file.fileno())

    shared_file.write(comm, path, pieces, finish, sync=True)


def _head(rows: Rows) -> bytes:
    """The beginning of an array of NumPy, before its rows."""
    head, form = io.BytesIO(), np.lib.format
    facts = form.header_data_from_array_1_0(  # type: ignore[no-untyped-call]
        np.ascontiguousarray(rows.own)
    )
    form.write_array_header_1_0(  # type: ignore[no-untyped-call]
        head, facts | {"shape": rows.shape}
    )
    return head.getvalue()


def read(path: Path, comm: Any = MPI.COMM_SELF) -> tuple[dict[str, Any], dict[str, Any]]:
    """Read a checkpoint; a call for all ranks.

    Returns:
        The identity of its run, and the state. What was written from `Rows` is an array on one rank,
        and `Rows` in equal blocks on several.

    Raises:
        CheckpointError: The file cannot be read, is damaged, or has another format.
    """
    with ExitStack() as stack:
        with raise_together(comm), _reading(path):
            entries = Entries(path, stack.enter_context(path.open("rb")))
            sums = entries.sums(comm)
        of_ranks = comm.allgather(sums)
        with raise_together(comm):
            with _reading(path):
                entries.check(of_ranks)
                about = json.loads(entries.whole(ABOUT).tobytes())
                found, identity = about["format"], about["identity"]
                state = _unpack(about["state"], entries, comm) if found == FORMAT else {}
            if found != FORMAT:
                raise CheckpointError(
                    f"checkpoint '{path}' has format {found!r}: this version of tawami reads format "
                    f"{FORMAT}"
                )
    return identity, state


@contextmanager
def _reading(path: Path) -> Iterator[None]:
    try:
        yield
    except Exception as error:
        raise CheckpointError(
            f"checkpoint '{path}' cannot be read ({reason(error)}): it is damaged, or is not a "
            "checkpoint of tawami"
        ) from None


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
    if isinstance(arrays, Mapping):
        arrays = {n: a.own if isinstance(a, Rows) else a for n, a in arrays.items()}
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
    if isinstance(own, Rows):
        own = own.own
    if isinstance(found, Rows):
        found = found.own
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
    if isinstance(value, np.ndarray | Rows):
        arrays[path] = value
        return {"rows" if isinstance(value, Rows) else "array": path}
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


def _unpack(value: Any, entries: Entries, comm: Any) -> Any:
    """The reverse of :func:`_pack`."""
    if isinstance(value, list):
        return [_unpack(item, entries, comm) for item in value]
    if not isinstance(value, dict):
        return value
    if "rows" in value and comm.size > 1:
        return entries.rows(value["rows"], comm)
    if "rows" in value or "array" in value:
        return entries.whole(value["array" if "array" in value else "rows"])
    return {name: _unpack(item, entries, comm) for name, item in value["items"].items()}
