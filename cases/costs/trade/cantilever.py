"""The cantilever with the support `exact`: deflection and mean stress against the closed form."""

from __future__ import annotations

import tawami
from cases.verification.cantilever import fem, mpm
from cases.verification.cantilever.beam import V_THEORY

BODIES = {
    "1 x 1": (1, False), "2 x 2": (2, False), "3 x 3": (3, False), "4 x 4": (4, False),
    "2 x 2 Gauss": (2, True), "3 x 3 Gauss": (3, True),
}  # fmt: skip
CELLS = (4, 8, 16, 32)
ALPHAS = (0.0, 0.003, 0.01, 0.03, 0.1)


def run(n: int, form: str, particles: str, **options: object) -> dict[str, float]:
    """Deflection [m] and relative L2 error of the mean stress by the MPM."""
    per_axis, gauss = BODIES[particles]
    row, _ = mpm.solve(form, "exact", n, per_axis=per_axis, gauss=gauss, **options)
    assert row.mean_stress_l2 is not None
    return {"deflection": row.deflection_m, "mean stress": row.mean_stress_l2}


def run_fem(n: int, element: str) -> dict[str, float]:
    """Deflection [m] and relative L2 error of the mean stress by finite elements."""
    row = fem.solve(element, "exact", n)
    assert row.mean_stress_l2 is not None
    return {
        "deflection": row.deflection_m, "mean stress": row.mean_stress_l2, "unknowns": row.unknowns,
        "newton_iterations": 1, "steps": 1,
    }  # fmt: skip


PARTICLES = ("2 x 2", "3 x 3")
GRIDS = [
    {"form": ("u", "u_bbar"), "n": CELLS, "particles": PARTICLES},
    {
        "form": ("u_epsv",), "stabilisation": ("laplacian", "projection", "residual_based"),
        "alpha": ALPHAS, "n": CELLS, "particles": PARTICLES,
    },
    {"form": ("u_epsv",), "stabilisation": ("laplacian",), "alpha": (0.01,), "n": CELLS,
     "particles": tuple(BODIES)},
    {"form": ("u_epsv",), "stabilisation": ("laplacian",), "alpha": (0.01,), "n": CELLS,
     "particles": ("3 x 3",), "basis": ("quadratic_spline", "bilinear", "biquadratic")},
    {"form": ("u_epsv_finite",), "alpha": (0.01,), "n": (4, 8), "particles": PARTICLES,
     "tolerance": (1e-2, 1e-4, 1e-6, 1e-8)},
    {"form": ("u_epsv",), "stabilisation": ("laplacian",), "alpha": (0.01,), "n": (32, 64),
     "particles": ("2 x 2",), "linear_solver": ("direct", "multigrid"),
     "factorise": ("when_it_pays", "always"),
     "tolerance": (1e-4, 1e-6)},
    {"form": ("u_epsv",), "stabilisation": ("laplacian",), "alpha": (0.01,), "n": (32, 64, 128),
     "particles": ("2 x 2",), "threads": (1, 2)},
]  # fmt: skip

SETTING = {"form": "u_epsv", "stabilisation": "laplacian", "n": ...}
STUDY = tawami.Study(
    "cantilever",
    tawami.Series("MPM", run, GRIDS),
    reference={"deflection": V_THEORY, "mean stress": 0.0},
    beside=[tawami.Series("FEM only", run_fem, {"element": fem.METHODS, "n": (*CELLS, 64)})],
    colour="form",
    marks={
        "paper's setting": SETTING | {"alpha": 0.1, "particles": "2 x 2"},
        "default": SETTING | {"alpha": 0.01, "particles": "3 x 3"},
    },
)
