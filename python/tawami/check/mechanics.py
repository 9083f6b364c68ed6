"""The mechanical part of a form: its fields without a role stay at zero."""

from __future__ import annotations

import inspect
from typing import Any

from tawami.form.form import Form

#: Parameter of the mechanical part, always 0: it stands for the fields that are left out.
REST = "field_at_rest"


def mechanical(form: Form) -> Form:
    """A form without its fields that no law receives; the form itself if it has none.

    Their values, increments and equations are multiplied by a constant that is zero, so that a term with
    them compiles, and does nothing.
    """
    own = form.own_fields
    if not own:
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


class _Old:
    """Old values, with those of some fields at rest."""

    def __init__(self, old: Any, at_rest: dict[str, Any]) -> None:
        self._old, self._at_rest = old, at_rest

    def __getattr__(self, name: str) -> Any:
        return self._at_rest[name] if name in self._at_rest else getattr(self._old, name)
