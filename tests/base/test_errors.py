"""The hierarchy of errors and warnings."""

import tawami
from tawami.base import errors


def test_every_public_error_and_warning_has_the_base_class():
    for name in tawami.__all__:
        kind = getattr(tawami, name)
        if name.endswith("Warning"):
            assert issubclass(kind, tawami.TawamiWarning)
            assert issubclass(kind, UserWarning)
        if name.endswith("Error"):
            assert issubclass(kind, tawami.TawamiError)


def test_the_docstring_lists_every_error_and_warning():
    words = errors.__doc__.split()
    assert all(name in words for name in errors.__all__)
