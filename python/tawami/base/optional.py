"""Packages that only some functions need: imported when they are used."""

from __future__ import annotations

import warnings
from importlib import import_module
from typing import Any

from tawami.base.errors import MissingDependencyError


def optional(module: str, purpose: str) -> Any:
    """A module of a package that need not be installed.

    Args:
        module: Its full name.
        purpose: Subject and verb of the message, as "pictures need".

    Raises:
        MissingDependencyError: The package is not installed; the message says how to install it.
    """
    try:
        # a package may warn, when it is imported, of packages that it would like to have
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return import_module(module)
    except ImportError as error:
        package = module.partition(".")[0]
        raise MissingDependencyError(f"{purpose} {package}: pip install {package}") from error
