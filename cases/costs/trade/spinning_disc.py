"""A free disc spins once: conservation of momentum and energy, and the mean stress."""

from __future__ import annotations

from typing import Any

import tawami
from cases.verification.spinning_disc import disc
from cases.verification.spinning_disc.disc import Kind


def run(form: str, transfer: Any, n: int, steps: int, **options: Any) -> dict[str, float]:
    """Relative changes of momenta and energy, and rms error of the mean stress."""
    spun = disc.solve(Kind(form, transfer, form, ""), turns=1, steps=steps, n=n, **options)
    return {
        "momentum": max(spun.linear),
        "angular momentum": spun.drift,
        "energy": abs(spun.energy[-1] - 1),
        "mean stress": spun.stress_error[-1],
    }


MIXED = {"form": ("u_epsv_finite",), "transfer": ("affine_flip",), "n": (4,), "steps": (150,)}
GRIDS = [
    {"form": ("u_epsv_finite", "u_bbar_finite", "u_finite"), "transfer": ("affine_flip",),
     "n": (4, 8), "steps": (75, 150, 300)},
    MIXED | {"transfer": ("affine_flip", "flip", "apic", "tpic", "pic")},
    MIXED | {"tolerance": (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-8)},
    MIXED | {"alpha": (0.0, 0.003, 0.01, 0.03, 0.1)},
    MIXED | {"per_axis": (2, 3, 4)},
]  # fmt: skip

STUDY = tawami.Study(
    "spinning_disc",
    tawami.Series("MPM", run, GRIDS),
    reference=dict.fromkeys(("momentum", "angular momentum", "energy", "mean stress"), 0.0),
    colour="form",
    marks={"default": {"form": "u_epsv_finite", "transfer": "affine_flip", "n": ..., "steps": 150}},
)
