"""Forms that tests declare."""

from __future__ import annotations

from tawami.form.form import Form


def form_of(function, fields=None, kinematics="displacement", **more):
    return Form(fields or {"u": ("displacement", "w")}, kinematics, function, **more)


BOTH = {"u": ("displacement", "w"), "eps_v": ("volumetric_strain", "q")}
