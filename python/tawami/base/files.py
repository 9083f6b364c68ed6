"""Files and folders of results: a file appears when it is whole, or not at all."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from tawami.base import checks
from tawami.base.errors import OutputError


def result_folder(path: str | Path) -> Path:
    """A folder that can be written, made if it is not there.

    Raises:
        OutputError: It cannot be made or written.
    """
    folder = checks.path("result folder", path)
    probe = folder / f".probe-{os.getpid()}"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        probe.touch()
        probe.unlink()
    except OSError as error:
        with suppress(OSError):
            probe.unlink(missing_ok=True)
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
    target = checks.path("path", path)
    if not target.name:
        raise OutputError(f"'{target}': expected the name of a file")
    part = target.with_name(f".{os.getpid()}-{target.name}")
    try:
        yield part
        part.replace(target)
    except OSError as error:
        raise OutputError(f"'{target}' cannot be written: {error.strerror or error}") from error
    finally:
        with suppress(OSError):  # where it could not be made, in a folder that is gone, ...
            part.unlink(missing_ok=True)
