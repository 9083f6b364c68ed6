"""The ring under pressure, nu = 0.4999: displacement and mean stress against Lamé's closed form."""

from __future__ import annotations

import tawami
from cases.verification import ring

SHIFTS = {"centred": ring.SHIFTS[0], "shifted": ring.SHIFTS[1]}


def run(n: int, form: str, particles: str, place: str, **options: object) -> dict[str, float]:
    """Displacement of the inner border over Lamé's, and rms error of the mean stress."""
    if particles == "3 x 3 Gauss":
        options |= {"gauss": True}
    found = ring.small(n, SHIFTS[place], form=form, **options)
    return {"displacement": 1 + found.radius / 100, "mean stress": found.rms / 100}


CELLS = (4, 8, 16)
MIXED = {"form": ("u_epsv",), "n": CELLS}
PLACES = tuple(SHIFTS)
GRIDS = [
    {"form": ("u", "u_bbar"), "n": CELLS, "particles": ("3 x 3",), "place": PLACES},
    MIXED | {"particles": ("3 x 3", "3 x 3 Gauss"), "volumes": ("full_cells", "own", "fitted"),
             "alpha": (0.01,), "place": PLACES},
    MIXED | {"particles": ("3 x 3",), "volumes": ("full_cells",), "alpha": (0.003, 0.03, 0.1),
             "place": PLACES},
    MIXED | {"particles": ("3 x 3",), "volumes": ("full_cells",), "alpha": (0.01,),
             "place": ("shifted",), "ghost_penalty": ("off", "on")},
]  # fmt: skip

STUDY = tawami.Study(
    "ring",
    tawami.Series("MPM", run, GRIDS),
    reference={"displacement": 1.0, "mean stress": 0.0},
    colour="form",
    marks={
        name: {
            "form": "u_epsv",
            "n": ...,
            "particles": "3 x 3",
            "volumes": "full_cells",
            "alpha": alpha,
            "place": "shifted",
        }
        for name, alpha in (("paper's alpha", 0.1), ("default", 0.01))
    },
)
