"""The cache of compiled forms: a folder for each, written under a lock and checked before it is loaded.

FFCx marks a form as being compiled by a file that stays behind if the process is killed, and it loads
compiled code unchecked. Here each form is compiled in a temporary folder, which is renamed when it is
complete and holds a checksum. A folder with other content is removed, and the form compiled again. So an
interrupted compilation needs no repair, and a damaged file is never executed.
"""

from __future__ import annotations

import functools
import hashlib
import os
import platform
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

from tawami.base import files, lock, ranks
from tawami.base.errors import MissingDependencyError, OutputError
from tawami.fem.dolfinx import OLD, jit

#: Longest time to wait for a form that another process compiles [s].
PATIENCE = 300.0
#: Names of the errors of CFFI and setuptools if the compiler fails.
COMPILER_ERRORS = ("VerificationError", "CompileError")
#: Folder of the compiled code in that of a form, and the file of its checksum there.
CODE, CHECKSUM = "code", "sha256"


@functools.cache
def cache_directory() -> Path:
    """Directory of compiled forms; each kind of processor has its own."""
    try:
        flags = next(s for s in Path("/proc/cpuinfo").read_text().splitlines() if "flags" in s)
    except (OSError, StopIteration):
        flags = platform.processor()
    default = jit.get_options()["cache_dir"] if not OLD else jit.get_parameters()["cache_dir"]
    return Path(default) / f"tawami-{hashlib.sha1(flags.encode()).hexdigest()[:10]}"


def compiled(comm: Any, key: str, compile_into: Callable[[Path], object]) -> Path:
    """Compile a form unless it is in the cache: one rank compiles it while the others wait.

    Args:
        comm: Communicator.
        key: Everything that the compiled code depends on.
        compile_into: Compiles the form into a folder that does not exist yet.

    Returns:
        The folder of its compiled code, which is intact.

    Raises:
        InputError: Another process compiles it for longer than `PATIENCE`.
        MissingDependencyError: The compiler failed.
        OutputError: The cache cannot be written.
    """
    code = cache_directory() / hashlib.sha256(key.encode()).hexdigest()[:40] / CODE
    # the first rank compiles, and after it the first rank of every machine with another cache
    for first in (True, False):
        with ranks.raise_together(comm):
            if first == (comm.rank == 0) and not intact(code):
                _compile(code, compile_into)
    return code


def _compile(code: Path, compile_into: Callable[[Path], object]) -> None:
    home = cache_directory()
    try:
        held = lock.hold(code.parent, f"the cache of compiled forms '{home}'", PATIENCE)
        try:
            if not intact(code):  # or another process has compiled it meanwhile
                _replace(code, compile_into)
        finally:
            held.release()
    except (OSError, OutputError) as error:
        raise OutputError(
            f"the cache of compiled forms '{home}' cannot be written "
            f"({files.reason(error.__cause__ or error)}): expected free space and write permission "
            "there, or another folder in the environment variable XDG_CACHE_HOME"
        ) from error
    except Exception as error:
        if type(error).__name__ not in COMPILER_ERRORS:
            raise
        raise MissingDependencyError(
            f"the C compiler failed on the code of FFCx: {error}. It needs gcc and Python's headers (on "
            f"Debian: apt install g++ python3-dev), memory, and free space in '{home}'"
        ) from error


def _replace(code: Path, compile_into: Callable[[Path], object]) -> None:
    for old in code.parent.glob(f"{CODE}*"):
        shutil.rmtree(old, ignore_errors=True)
    # under a name of its own: the compiler of a killed process may still write to another one
    part = code.with_name(f"{CODE}-{os.getpid()}")
    try:
        compile_into(part)
        (part / CHECKSUM).write_text(_content(part))
        part.rename(code)
    finally:
        shutil.rmtree(part, ignore_errors=True)


def intact(folder: Path) -> bool:
    """Whether a folder of compiled code has not changed since it was compiled."""
    try:
        return (folder / CHECKSUM).read_text() == _content(folder)
    except (OSError, UnicodeDecodeError):
        return False


def _content(folder: Path) -> str:
    """Checksum of the names and contents of the other files of a folder."""
    total = hashlib.sha256()
    for path in sorted(folder.iterdir()):
        if path.name != CHECKSUM:
            total.update(os.fsencode(path.name) + b"\0")
            total.update(hashlib.sha256(path.read_bytes()).digest())
    return total.hexdigest()
