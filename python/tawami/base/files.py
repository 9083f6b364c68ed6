"""Files and folders: paths checked before use, files written atomically."""

from __future__ import annotations

import difflib
import errno
import os
import platform
import re
import stat
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from tawami.base import checks
from tawami.base.errors import InputError, OutputError
from tawami.base.text import suggestion

#: Temporary files: .PROCESS@HOST@NAME.
PART = re.compile(r"\.(\d+)@([^@]*)@.*", re.DOTALL)
#: Age from which a temporary file of another host is a leftover [s].
OLD = 86400.0


def reason(error: BaseException) -> str:
    """Reason of a failure, in the words of the system where possible."""
    return getattr(error, "strerror", None) or str(error) or type(error).__name__


def unreadable(path: Path) -> str | None:
    """Reason why a path is not a regular file that can be read; None if it is one."""
    try:
        check_regular(path)
        with path.open("rb"):
            return None
    except (OSError, ValueError) as error:
        return reason(error)


def readable_file(what: str, path: str | Path, expected: str) -> Path:
    """The path of a regular file that can be read.

    Args:
        what: Name of the file in messages, as 'script'.
        path: Its path.
        expected: Text after 'expected' in messages.

    Raises:
        InputError: No path, or not that of such a file.
    """
    file = checks.path(what, path)
    problem = unreadable(file)
    if problem is not None:
        hint = suggestion(None if os.path.lexists(file) else nearest(file, _alike(file)))
        raise InputError(f"{what} '{file}' cannot be read ({problem}): expected {expected}{hint}")
    return file


def nearest(path: Path, fits: Callable[[Path], bool]) -> Path | None:
    """The path that fits and whose names are nearly those of this path; None without one.

    Args:
        path: A path that does not exist.
        fits: Whether a path is one of those to choose from.
    """
    *folders, name = path.parts or ("",)
    found = Path()
    for part in folders:
        if not os.path.isdir(found / part):
            near = difflib.get_close_matches(part, _names(found, Path.is_dir), 1)
            if not near:
                return None
            part = near[0]
        found /= part
    names = _names(found, fits)
    near = [name] if name in names else difflib.get_close_matches(name, names, 1)
    return found / near[0] if near else None


def _names(folder: Path, fits: Callable[[Path], bool]) -> list[str]:
    try:
        return sorted(path.name for path in folder.iterdir() if fits(path))
    except OSError:
        return []


def _alike(file: Path) -> Callable[[Path], bool]:
    """Whether a path is that of a file of the same kind; of any kind if this one has no ending."""
    return lambda path: path.is_file() and file.suffix in ("", path.suffix)


def result_folder(path: str | Path) -> Path:
    """A folder that can be written; created if it does not exist.

    Raises:
        OutputError: It cannot be created or written.
    """
    folder = checks.path("result folder", path)
    probe = temporary(folder / "probe")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        probe.touch()
        probe.unlink()
    except OSError as error:
        with suppress(OSError):
            probe.unlink(missing_ok=True)
        raise OutputError(
            f"result folder '{folder}' cannot be written ({reason(error)}): expected a folder with "
            "write permission; choose another one"
        ) from error
    return folder


@contextmanager
def atomic_file(path: str | Path) -> Iterator[Path]:
    """A temporary path in the folder of `path`; it is renamed to `path` when the block succeeds.

    Raises:
        OutputError: The file cannot be written; an older file at `path` is kept.
    """
    target = checks.path("path", path)
    if not target.name:
        raise OutputError(f"'{target}': expected the name of a file")
    part = temporary(target)
    with writing(target):
        try:
            check_regular(target, new=True)
            yield part
            part.replace(target)
        finally:
            with suppress(OSError):  # it was never created, or its folder is gone
                part.unlink(missing_ok=True)


def host() -> str:
    """Name of this computer, as it can be part of the name of a file."""
    return platform.node().replace("@", "-")[:40]


def alive(number: int) -> bool:
    """Whether a process of this host runs."""
    try:
        os.kill(number, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except PermissionError:  # of another user
        return True
    return True


def temporary(target: Path) -> Path:
    """Temporary path for a file; it names the process and its host."""
    return target.with_name(f".{os.getpid()}@{host()}@{target.name}")


def remove_leftovers(folder: Path) -> None:
    """Remove temporary files of processes that were killed, in a folder and the folders in it.

    On this host a process tells whether it runs. The file of another host must be a day old.
    """
    for path in folder.rglob(".*@*@*"):
        match = PART.fullmatch(path.name)
        if match is None:
            continue
        with suppress(OSError):  # it is gone, or cannot be removed
            old = time.time() - path.lstat().st_mtime > OLD
            if old if match[2] != host() else not alive(int(match[1])):
                path.unlink()


def append_line(path: str | Path, line: str, *, sync: bool = False) -> None:
    """Append a line to a file; a line before it that was cut off is ended first.

    Args:
        path: The file; created if it does not exist.
        line: Text without a line end.
        sync: Wait until it is on the disk.

    Raises:
        OutputError: The file cannot be written; it is unchanged.
    """
    file_path = checks.path("path", path)
    with writing(file_path):
        check_regular(file_path, new=True)
        with file_path.open("a+b", buffering=0) as file:
            size = file.seek(0, os.SEEK_END)
            if size:
                file.seek(-1, os.SEEK_END)
                line = line if file.read(1) == b"\n" else "\n" + line
            try:
                rest = (line + "\n").encode()
                while rest:
                    rest = rest[file.write(rest) :]
                if sync:
                    os.fsync(file.fileno())
            except OSError:
                with suppress(OSError):
                    file.truncate(size)
                raise


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """The block writes a file: errors of the system are raised as OutputError."""
    try:
        yield
    except OSError as error:
        raise OutputError(f"'{path}' cannot be written: {reason(error)}") from error


def check_regular(path: Path, *, new: bool = False) -> None:
    """Check before a file is opened: to open a pipe would wait forever.

    Args:
        path: Of the file.
        new: Whether it need not exist.

    Raises:
        OSError: The path is that of a folder, a pipe, a socket, ...
    """
    if new and not os.path.exists(path):
        return
    mode = path.stat().st_mode
    if stat.S_ISDIR(mode):
        raise OSError(errno.EISDIR, os.strerror(errno.EISDIR))
    if not stat.S_ISREG(mode):
        raise OSError(errno.EINVAL, "Not a regular file")
