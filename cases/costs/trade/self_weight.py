"""A column under its own weight: small or finite strain, static or in motion until it is at rest."""

from __future__ import annotations

import numpy as np

import tawami
from cases.verification import self_weight
from cases.verification.self_weight import WEIGHT, E, G, H

#: First natural period of the unloaded column [s].
PERIOD = 4 * H / float(np.sqrt(E / (WEIGHT / G)))
SIZES = (5.0, 2.5, 1.0, 0.5)
#: Without inertia, or with inertia and damped (gamma = 1) until the column is at rest.
INERTIA = ("none", "damped")


def run(form: str, h: float, inertia: str, increments: int, **options: object) -> dict[str, float]:
    """Errors of height and stress, with `increments` of the weight or time steps of a natural period."""
    scene = self_weight.build(form, h, **options)
    if inertia == "none":
        weight = scene.gravity((0.0, 0.0))
        for k in range(1, increments + 1):
            weight.change((0.0, -G * k / increments))
            scene.solve()
    else:
        scene.gravity((0.0, -G))
        motion = tawami.Dynamics(scene, gamma=1.0)
        motion.run(increments * PERIOD, PERIOD)
    height, stress = self_weight.errors(scene, form)
    return {"height": 1 + height, "stress": stress}


GRIDS = [
    {"form": ("u_epsv",), "inertia": ("none",), "increments": (1, 5), "h": SIZES},
    {"form": ("u_epsv_finite", "u_finite", "u_bbar_finite"), "inertia": INERTIA,
     "increments": (5, 10, 20, 40), "h": SIZES},
    {"form": ("u_epsv_finite",), "inertia": ("none",), "increments": (10, 20), "h": (1.0,),
     "tolerance": (1e-2, 1e-4, 1e-6, 1e-8), "factorise": ("when_it_pays", "always")},
]  # fmt: skip

STUDY = tawami.Study(
    "self_weight",
    tawami.Series("MPM", run, GRIDS),
    reference={"height": 1.0, "stress": 0.0},
    colour="form",
    marks={"default": {"form": "u_epsv_finite", "inertia": "none", "increments": 10, "h": ...}},
)
