"""The mechanical part of a form: fields without a role stay at zero, and nothing acts on the border."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any

from tawami.form.form import Form

#: Parameter of the mechanical part, always 0: it stands for the fields that are left out.
REST = "field_at_rest"


def mechanical(form: Form) -> Form:
    """A form without its fields that no law receives and without its sums over the border.

    These fields, their equations and these sums are multiplied by a constant that is zero, so that such
    a term compiles, and does nothing. A form without them is returned as it is.
    """
    own = form.own_fields
    if not own and "sum_b" not in inspect.signature(form.residual).parameters:
        return form
    left_out = {*own, *(field.test for field in own.values())}
    wanted = list(inspect.signature(form.residual).parameters)
    test = next(iter(form.fields.values())).test
    asked = dict.fromkeys([*(n for n in wanted if n not in left_out), test, REST])

    def residual(**names: Any) -> Any:
        zero, w = names.pop(REST), names[test]
        names |= dict.fromkeys(own, zero)
        names |= {field.test: zero * w[0] for field in own.values()}
        names["old"] = _Old(names["old"], dict.fromkeys(own, zero)) if "old" in wanted else None
        if "sum_b" in wanted:
            names["sum_b"] = _scaled(names["sum_b"], zero)
        return form.residual(**{name: names[name] for name in wanted})

    keyword = inspect.Parameter.KEYWORD_ONLY
    arguments = [inspect.Parameter(name, keyword) for name in asked]
    residual.__signature__ = inspect.Signature(arguments)  # type: ignore[attr-defined]
    residual.__wrapped__ = form.residual  # type: ignore[attr-defined]
    return Form(
        fields={name: field for name, field in form.fields.items() if name not in own},
        residual=residual,
        kinematics=form.kinematics,
        data=form.data,
        parameters={**form.parameters, REST: {"default": 0.0}},
        options=form.options,
        strain=form.strain,
        whole_cells=form.whole_cells,
        static_options=form.static_options,
        name=form.name,
    )


def _scaled(sum_b: Callable[..., Any], factor: Any) -> Callable[..., Any]:
    """A sum over the border times a factor."""
    return lambda f, on=None: sum_b(factor * f, on=on)


class _Old:
    """Old values, with those of some fields at rest."""

    def __init__(self, old: Any, at_rest: dict[str, Any]) -> None:
        self._old, self._at_rest = old, at_rest

    def __getattr__(self, name: str) -> Any:
        return self._at_rest[name] if name in self._at_rest else getattr(self._old, name)
