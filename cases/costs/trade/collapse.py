"""The collapse of a pile to 0.3 s: run-out, profile and mean stress against the finest run."""

from __future__ import annotations

from typing import Any

import numpy as np

import tawami
from cases.showcase.collapse import pile

END = 0.3  # [s]
#: Side of the squares over which heights and mean stress are averaged [m].
BOX = 0.02
#: Number of squares along x and y.
BOXES = (30, 6)


def run(form: str, h: float, dt: float, **options: Any) -> dict[str, Any]:
    """Run-out [m], heights of strips [m], mean stress of squares [Pa] and its roughness at the end."""
    motion = pile.build(form, h=h, **options)
    motion.run(END, dt)
    particles = motion.scene.particles
    x, volume = np.array(particles.x), np.array(particles.volume)
    mean_stress = particles.stress[:, :3].mean(axis=1)
    edges = [BOX * np.arange(n + 1) for n in BOXES]
    filled, stress = (
        np.histogram2d(*x.T, bins=edges, weights=weight)[0]
        for weight in (volume, volume * mean_stress)
    )
    return {
        "run-out": float(np.quantile(x[:, 0], 0.99)),
        "profile": (filled.sum(axis=1) / BOX).tolist(),
        "mean stress": (stress / BOX**2).ravel().tolist(),
        "roughness": pile.roughness(x, mean_stress, h),
    }


MIXED = {"form": ("u_epsv_finite",), "h": (0.01,), "dt": (2e-3,)}
GRIDS = [
    {"form": ("u_epsv_finite", "u_finite", "u_bbar_finite"), "h": (0.02, 0.01, 0.005),
     "dt": (4e-3, 2e-3, 1e-3)},
    MIXED | {"transfer": ("affine_flip", "flip", "apic", "tpic", "pic")},
    MIXED | {"alpha": (0.0, 0.003, 0.01, 0.03, 0.1)},
    MIXED | {"per_axis": (1, 2, 3, 4)},
    MIXED | {"tolerance": (1e-2, 1e-3, 1e-4, 1e-6, 1e-8)},
    MIXED | {"factorise": ("when_it_pays", "always")},
    MIXED | {"linear_solver": ("direct", "multigrid")},
    MIXED | {"ghost_penalty": ("off", "on")},
    MIXED | {"threads": (1, 2)},
]  # fmt: skip

STUDY = tawami.Study(
    "collapse",
    tawami.Series("MPM", run, GRIDS),
    reference={"run-out": None, "profile": None, "mean stress": None, "roughness": 0.0},
    finest={"form": "u_epsv_finite", "h": 0.005, "dt": 5e-4, "per_axis": 3},
    colour="form",
    marks={
        "alpha = 0.01, 2 x 2 particles": {"form": "u_epsv_finite", "h": ..., "dt": 2e-3},
        "paper's setting": {"form": "u_epsv_finite", "h": ..., "dt": ..., "alpha": 0.1},
    },
)
