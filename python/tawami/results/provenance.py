"""Provenance of results: script, form, versions and machine of a run, as `run.json` records them."""

from __future__ import annotations

import hashlib
import inspect
import json
import os
import subprocess
import sys
import textwrap
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from tawami.base import program, ranks
from tawami.base.files import atomic_file, result_folder
from tawami.fem import environment
from tawami.form.form import DECLARATIONS, Form
from tawami.form.kinematics import Kinematics, StrainMeasure
from tawami.motion.observer import Subject

#: Names of the record, and of the copies of the driver script and of the form.
RUN, SCRIPT, FORM = "run.json", "script.py", "form.py"
#: Variable of `__main__` with its source, if this is not in its file.
SOURCE = "__tawami_source__"
#: Time limit of git [s].
PATIENCE = 10


def write(folder: str | Path, subject: Subject) -> None:
    """Write run.json, and form.py and script.py if their sources can be read; a call for all ranks.

    run.json holds: script (path, or null), module (as in `python -m`, or null), arguments, directory,
    python, ranks, script_sha256, versions, environment, blas, threads, processors, git (revision, and
    whether tracked files were changed; null without git), form (name and file), input (the header of
    the scene), grid, started (UTC) and phases, empty at first.

    Raises:
        OutputError: The folder cannot be written.
    """
    scene, header = subject.scene, subject.header()
    comm = scene.grid.comm
    with ranks.raise_together(comm):
        if comm.rank == 0:
            home = result_folder(folder)
            script, module = driver()
            own = getattr(sys.modules["__main__"], SOURCE, None)
            source = own if own or script is None else _bytes(script)
            known = {
                "script": None if script is None else str(script),
                "module": module,
                "arguments": sys.argv[1:],
                "directory": os.getcwd(),
                "python": sys.executable,
                "ranks": comm.size,
                "script_sha256": None if source is None else hashlib.sha256(source).hexdigest(),
                "versions": environment.versions(),
                "environment": environment.header(),
                "blas": environment.blas()[0],
                "threads": {name: os.environ.get(name) for name in THREADS},
                "processors": os.cpu_count(),
                "git": None if script is None else git(script.parent),
                "form": {"name": scene.form.name.strip("'"), "source": _file_of(scene.form)},
                "input": header.splitlines(),
                "grid": {
                    "origin": scene.grid.origin, "h": scene.grid.h, "cells": scene.grid.cells,
                    "geometry": scene.grid.geometry,
                },
                "started": now(),
                "phases": [],
            }  # fmt: skip
            _write(home / FORM, source_of(scene.form))
            _write(home / SCRIPT, source)
            _write(home / RUN, (json.dumps(known, indent=1) + "\n").encode())


#: Environment variables with the number of threads.
THREADS = ("OMP_NUM_THREADS", "RAYON_NUM_THREADS")


def now() -> str:
    """Date and time (UTC) for records."""
    return datetime.now(UTC).isoformat(timespec="seconds")


def driver() -> tuple[Path | None, str | None]:
    """The script that Python runs, and its name if it was started as `python -m NAME`."""
    main = sys.modules["__main__"]
    file = getattr(main, "__file__", None)
    name = getattr(getattr(main, "__spec__", None), "name", None)
    script = None if file is None else Path(file).resolve()
    exists = script is not None and (script.is_file() or hasattr(main, SOURCE))
    return (script if exists else None), (name or "").removesuffix(".__main__") or None


def git(folder: Path) -> dict[str, Any] | None:
    """Revision of the repository of a folder, and whether tracked files differ from it.

    None without git, a repository, or a revision.
    """

    def ask(*words: str) -> str:
        command = ["git", "-C", str(folder), *words]
        run = subprocess.run(
            command, capture_output=True, text=True, check=True, timeout=PATIENCE,
            stdin=subprocess.DEVNULL, env=program.own_environment(),
        )  # fmt: skip
        return run.stdout.strip()

    try:
        changes = ask("status", "--porcelain", "--untracked-files=no")
        return {"revision": ask("rev-parse", "HEAD"), "changed": bool(changes)}
    except (OSError, subprocess.SubprocessError, UnicodeDecodeError):
        return None


def source_of(form: Form) -> bytes | None:
    """Content of the file of a form.

    For a form defined in a script, a file with its declarations and its residual; it can be loaded if
    the residual uses nothing else of the script. None if Python does not have the source.
    """
    file = _file_of(form)
    declared = getattr(form.residual, "__globals__", {})
    if file is not None and declared.get("residual") is form.residual and "fields" in declared:
        return _bytes(Path(file))
    try:
        source = textwrap.dedent(inspect.getsource(form.residual))
    except (OSError, TypeError):
        return None
    import ufl

    code = getattr(form.residual, "__code__", None)
    names = sorted(name for name in getattr(code, "co_names", ()) if hasattr(ufl, name))
    name = getattr(form.residual, "__name__", "residual")
    lines = [f"# Form {form.name}: defined in {file}", "from tawami.form import scalar, vector"]
    lines += [f"from ufl import {', '.join(names)}"] if names else []
    for key in DECLARATIONS:
        value = getattr(form, key)
        text = str(value) if isinstance(value, Kinematics | StrainMeasure) else value
        lines.append(f"{key} = {text!r}")
    lines += ["", "", source.rstrip()]
    lines += [] if name == "residual" else ["", "", f"residual = {name}"]
    return ("\n".join(lines) + "\n").encode()


def _file_of(form: Form) -> str | None:
    try:
        file = inspect.getsourcefile(form.residual)
        return None if file is None else str(Path(file).resolve(strict=True))
    except (OSError, TypeError):
        return None


def _bytes(path: Path) -> bytes | None:
    try:
        return path.read_bytes()
    except OSError:
        return None


def _write(path: Path, content: bytes | None) -> None:
    if content is not None:
        with atomic_file(path) as part:
            part.write_bytes(content)
