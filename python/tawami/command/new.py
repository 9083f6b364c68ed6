"""New driver scripts, from templates."""

from __future__ import annotations

import keyword
import os
import sys
from importlib.machinery import PathFinder
from pathlib import Path

from tawami.base import checks
from tawami.base.errors import InputError
from tawami.base.files import writing

TEMPLATES = Path(__file__).parent / "templates"


def write(name: str, kind: str) -> Path:
    """Write a script.

    Args:
        name: Its path, with or without .py. Folders that do not exist are created.
        kind: Name of the template.

    Returns:
        The path of the script.

    Raises:
        InputError: A file of this name exists, or Python could not import it.
        OutputError: The file cannot be written.
    """
    path = checks.path("tawami new: NAME", name)
    path = path if path.suffix == ".py" else path.parent / f"{path.name}.py"
    if os.path.lexists(path):
        raise InputError(f"'{path}' exists already, and was not changed: expected a new name")
    problem = _unusable(path)
    if problem is not None:
        raise InputError(
            f"'{name}': {problem}: expected another name of letters, digits and _, as mycase, so "
            "that Python files can import it"
        )
    text = (TEMPLATES / f"{kind}.py").read_text(encoding="utf-8")
    with writing(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("x", encoding="utf-8") as file:
            file.write(text.replace("SCRIPT.py", path.name).replace("SCRIPT", path.stem))
    return path


def _unusable(path: Path) -> str | None:
    """Reason why a script cannot have this name; None if it can."""
    name = path.stem
    if not name.isidentifier():
        return f"'{name}' is not a valid name in Python"
    if keyword.iskeyword(name):
        return f"'{name}' is a keyword of Python"
    if name.startswith("__"):
        return f"'{name}' is reserved by Python"
    # a script is the first that Python finds: a numpy.py would be imported instead of NumPy
    own = {Path.cwd(), path.parent.resolve()}
    installed = [folder for folder in sys.path if folder and Path(folder).resolve() not in own]
    names = {*sys.stdlib_module_names, *sys.builtin_module_names}
    if name in names or PathFinder.find_spec(name, installed) is not None:
        return f"the module '{name}' is installed"
    return None
