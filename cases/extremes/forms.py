"""The small-strain forms and the bases that the subjects try."""

from __future__ import annotations

from typing import Any

FORMS: dict[str, dict[str, Any]] = {
    "u": {"form": "u"},
    "u_bbar": {"form": "u_bbar"},
    "u_epsv": {"form": "u_epsv"},
    "u_epsv, alpha = 0": {"form": "u_epsv", "alpha": 0.0},
    "u_p": {"form": "u_p"},
}
BASES = ("quadratic_spline", "bilinear", "biquadratic")
