"""Files and folders of results: a file appears when it is whole, or not at all."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tawami.errors import OutputError


def result_folder(path: str | Path) -> Path:
    """A folder that can be written, made if it is not there.

    Raises:
        OutputError: It cannot be made or written.
    """
    folder = Path(path)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        probe = folder / f".probe-{os.getpid()}"
        probe.touch()
        probe.unlink()
    except OSError as error:
        raise OutputError(
            f"result folder '{folder}' cannot be written ({error.strerror}): expected a folder with "
            "write permission; choose another one"
        ) from error
    return folder


@contextmanager
def whole_file(path: str | Path) -> Iterator[Path]:
    """A temporary path beside `path` that takes its name when the block ends well.

    Raises:
        OutputError: The file cannot be written; what was at `path` before is still there.
    """
    target = Path(path)
    part = target.with_name(f".{os.getpid()}-{target.name}")
    try:
        yield part
        part.replace(target)
    except OSError as error:
        raise OutputError(f"'{target}' cannot be written: {error.strerror or error}") from error
    finally:
        part.unlink(missing_ok=True)
