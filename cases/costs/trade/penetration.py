"""A round pile pressed into clay: force at a quarter of its width, against a published fit.

The fit is one of finite element results (`cases.verification.penetration`), so that errors of a few per
cent do not measure the method.
"""

from __future__ import annotations

import tawami
from cases.verification import penetration


def run(form: str, n: int, step: float) -> dict[str, float]:
    """Force at the depth of the comparison over s_u B; `step` is that of the depth, over B."""
    found = penetration.solve("clay", form, n, penetration.COMPARED + 1e-9, step)
    if found.stopped:
        raise tawami.ConvergenceError(f"ended at {found.depth:.3g} B: {found.stopped}", [])
    return {"force": found.q}


GRIDS = {"form": tuple(penetration.FORMS), "n": (2, 4), "step": (0.05, 0.025)}

STUDY = tawami.Study(
    "penetration",
    tawami.Series("MPM", run, GRIDS),
    reference={"force": float(penetration.cylinder(penetration.COMPARED))},
    colour="form",
    marks={"default": {"form": "u_epsv_finite", "n": ..., "step": 0.025}},
)
