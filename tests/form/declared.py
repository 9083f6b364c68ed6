"""Forms that tests declare."""

from __future__ import annotations

from tawami.form import scalar, vector
from tawami.form.form import Form


def form_of(function, fields=None, **more):
    return Form(fields or {"u": vector("w")}, function, **more)


BOTH = {"u": vector("w"), "eps_v": scalar("q", role="volumetric_strain")}
