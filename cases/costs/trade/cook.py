"""Cook's membrane, nu = 0.4999: the deflection against the limit of finite elements.

Some settings are on the front because two errors cancel: a lattice without the particles outside the
membrane is too soft, displacement only is too stiff. Their error has no order of convergence and does
not measure the method.
"""

from __future__ import annotations

import tawami
from cases.verification.cook import fem, mpm
from cases.verification.cook.membrane import LENGTH, MIDDLE, REFERENCE

NU = 0.4999
SIZES = (4.0, 2.0, 1.0, 0.5)
ALPHAS = (0.0, 0.003, 0.01, 0.03, 0.1)


def run(h: float, body: str, form: str, **options: object) -> dict[str, float]:
    """Deflection by the MPM."""
    scene = mpm.scene_of(NU, h, body, form=form, **options)
    return {"deflection": scene.solve().displacement(MIDDLE)[1]}


def run_fem(element: str, h: float) -> dict[str, float]:
    """Deflection by finite elements."""
    row = fem.solve(element, NU, round(LENGTH / h))
    return {
        "deflection": row.deflection, "unknowns": row.unknowns, "newton_iterations": 1, "steps": 1
    }  # fmt: skip


GRIDS = [
    {"form": ("u", "u_bbar"), "h": SIZES, "body": mpm.BODIES},
    {"form": ("u_epsv",), "stabilisation": ("laplacian", "projection"), "alpha": ALPHAS, "h": SIZES,
     "body": mpm.BODIES},
    {"form": ("u_epsv",), "stabilisation": ("laplacian",), "alpha": (0.01,), "h": SIZES,
     "body": ("gauss",), "ghost_penalty": ("off", "on")},
    {"form": ("u_epsv",), "stabilisation": ("laplacian",), "alpha": (0.01,), "h": (1.0, 0.5),
     "body": ("gauss",), "linear_solver": ("direct", "multigrid"), "threads": (1, 2)},
]  # fmt: skip

SETTING = {"form": "u_epsv", "stabilisation": "laplacian", "h": ...}
STUDY = tawami.Study(
    "cook",
    tawami.Series("MPM", run, GRIDS),
    reference={"deflection": REFERENCE[NU]},
    beside=[tawami.Series("FEM only", run_fem, {"element": fem.METHODS, "h": (*SIZES, 0.25)})],
    colour="form",
    marks={
        "paper's setting": SETTING | {"alpha": 0.1, "body": "even"},
        "default, with Gauss points": SETTING | {"alpha": 0.01, "body": "gauss"},
    },
)
