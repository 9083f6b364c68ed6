"""The source text of functions that a user passes."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any


def source_of(function: Callable[..., Any]) -> str:
    """Source text of a function, or its byte code if the text is not available."""
    try:
        return inspect.getsource(function)
    except (OSError, TypeError):
        code = getattr(function, "__code__", None)
        return type(function).__name__ if code is None else code.co_code.hex()
