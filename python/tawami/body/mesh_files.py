"""Mesh files: the reader of each format, and the output of readers."""

from __future__ import annotations

import contextlib
import io
import re
import warnings
from pathlib import Path
from typing import Any

from tawami.base.checks import path, shown
from tawami.base.errors import GeometryWarning, InputError
from tawami.base.files import unreadable
from tawami.base.warn import warn
from tawami.body import abaqus, gmsh, kratos


def read(source: Any) -> Any:
    """A mesh of meshio from a file, or the mesh itself.

    Abaqus and Kratos files are read by this package: meshio does not know plane strain elements, and
    numbers the elements of sets wrongly. Everything else is read by meshio.

    Raises:
        InputError: The source is neither, or the file cannot be read.

    Warns:
        GeometryWarning: meshio has a warning.
    """
    import meshio

    if isinstance(source, meshio.Mesh):
        return source
    if not isinstance(source, str | Path):
        raise InputError(
            f"mesh: source = {shown(source)}: expected the path of a mesh file or a meshio.Mesh"
        )
    file = path("mesh: source", source)
    problem = unreadable(file)
    if problem is not None:
        raise InputError(f"mesh: '{source}' cannot be read ({problem}): expected a mesh file")
    own = {".inp": abaqus.read, ".mdpa": kratos.read}.get(file.suffix.lower())
    try:
        if own is not None:
            return own(file)
        return gmsh.read(file, _by_meshio) if gmsh.is_gmsh(file) else _by_meshio(file, None)
    except InputError:
        raise
    except Exception as error:
        why = str(error) if isinstance(error, UnreadError) else f"{type(error).__name__}: {error}"
        known = sorted({*meshio.extension_to_filetypes, ".inp", ".mdpa"})
        one = "its extension" if file.suffix.lower() in known else f"one of {', '.join(known)}"
        raise InputError(
            f"mesh: '{source}' cannot be read ({why}): expected a complete file in the format of {one}"
        ) from error


class UnreadError(Exception):
    """meshio ended the program; the message is its printed output."""


def _by_meshio(file: Path, file_format: str | None) -> Any:
    """A file read by meshio, with one warning for all that it prints."""
    import meshio

    printed = io.StringIO()
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(printed):
                found = meshio.read(file, file_format)
        except SystemExit as error:  # it ends the program if no reader fits
            raise UnreadError(_text(printed, []).replace(str(file), file.name)) from error
    told = _text(printed, caught)
    if told:
        warn(f"mesh: meshio reads '{file.name}' with a warning: {told}", GeometryWarning)
    return found


def _text(printed: io.StringIO, caught: list[Any]) -> str:
    lines = [printed.getvalue(), *(str(warning.message) for warning in caught)]
    return re.sub(r"\s+", " ", " ".join(lines)).strip()
