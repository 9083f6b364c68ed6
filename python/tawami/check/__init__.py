"""Checks of weak forms, as `tawami form check` runs them."""

from tawami.check.form_check import check_form
from tawami.check.report import FormReport

__all__ = ["FormReport", "check_form"]
