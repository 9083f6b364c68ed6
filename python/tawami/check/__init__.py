"""Checks of weak forms, as `tawami form check` runs them."""

from tawami.check.form_check import FormReport, check_form

__all__ = ["FormReport", "check_form"]
