"""Whether terms are linear in their test and trial functions."""

from __future__ import annotations

from typing import Any

from ufl.algorithms import expand_derivatives
from ufl.algorithms.check_arities import ArityMismatch, check_form_arity
from ufl.algorithms.remove_complex_nodes import remove_complex_nodes

from tawami.base.errors import FormError


def is_multilinear(form: Any) -> bool:
    """Whether a form is linear in its test function and in its trial function."""
    expanded = remove_complex_nodes(expand_derivatives(form))
    try:
        check_form_arity(expanded, form.arguments())
    except (ArityMismatch, TypeError, ValueError):  # UFL may fail where it writes its own message
        return False
    return True


def check_arity(form: Any, where: str) -> None:
    """Check that a form is linear in its test function and in its trial function.

    Args:
        form: The form.
        where: Name and line of the form, for the message.

    Raises:
        FormError: It is not.
    """
    if not is_multilinear(form):
        raise FormError(
            f"{where}: not linear in a test function. Each term must be linear in one test function"
        )
