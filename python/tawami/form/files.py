"""Files of weak forms: those shipped in `tawami/forms`, and those of users."""

from __future__ import annotations

import functools
import importlib.util
from pathlib import Path
from types import ModuleType

from tawami.base.checks import path as as_path
from tawami.base.errors import FormError
from tawami.base.files import nearest, unreadable
from tawami.base.text import meant, quoted, suggestion

#: Folder of the shipped forms.
SHIPPED = Path(__file__).parents[1] / "forms"


def shipped() -> list[str]:
    """Names of the shipped forms."""
    return sorted(path.stem for path in SHIPPED.glob("[!_]*.py"))


def module_of(source: str | Path) -> ModuleType:
    """The module of a form file; the same object as long as the file does not change.

    Args:
        source: Name of a shipped form, or path of a file that ends in .py.

    Raises:
        FormError: The file does not exist, or raises an error when it is imported.
    """
    path = file_of(source).resolve()
    return _imported(path, path.stat().st_mtime_ns)


def file_of(source: str | Path) -> Path:
    """The file of a form.

    Args:
        source: Name of a shipped form, or path of a file that ends in .py.

    Raises:
        FormError: The file does not exist, or cannot be read.
    """
    path = as_path("form", source)
    if path.suffix != ".py":
        file = Path(f"{source}.py")
        path = SHIPPED / f"{source}.py"
        if unreadable(path) is not None:
            hint = suggestion(file) if file.is_file() else meant(str(source), shipped())
            raise FormError(
                f"form '{source}' is not shipped: expected one of {quoted(shipped())}, "
                f"or the path of a .py file{hint}"
            )
    problem = unreadable(path)
    if problem is not None:
        hint = suggestion(nearest(path, lambda other: other.suffix == ".py"))
        raise FormError(
            f"form file '{source}' cannot be read ({problem}): expected a Python file with a form{hint}"
        )
    return path


@functools.cache
def _imported(path: Path, _modified: int) -> ModuleType:
    specification = importlib.util.spec_from_file_location(f"tawami_form_{path.stem}", path)
    assert specification is not None
    assert specification.loader is not None
    module = importlib.util.module_from_spec(specification)
    try:
        specification.loader.exec_module(module)
    except Exception as error:
        raise FormError(f"form file '{path.name}' cannot be read: {error!r}") from error
    return module
