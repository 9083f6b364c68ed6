"""The report of the study, as Markdown."""

from __future__ import annotations

from collections.abc import Sequence

from cases.common.table import as_markdown
from cases.verification.cantilever.beam import (
    COLUMNS,
    SUPPORTS,
    V_THEORY,
    P,
    Row,
    point_support_growth,
)
from tawami.fem.environment import header


def report(rows: Sequence[Row]) -> str:
    """The study as a page of Markdown."""
    sections = [
        "# Cantilever: mixed u-eps_v MPM compared with B-bar, displacement only and FEM",
        header(),
        "Beam and supports are defined in `cases/verification/cantilever/beam.py`. "
        f"v_theory = {V_THEORY:.10f} m, eq. (3).",
        paper_support(rows),
        "![error of the tip deflection](deflection_error.png)",
        "![mean stress, support paper](mean_stress_paper.png)",
        "![mean stress, support exact](mean_stress_exact.png)",
    ]
    for support in SUPPORTS:
        mine = [row for row in rows if row.support == support]
        sections += [f"## Support `{support}`", as_markdown(mine, COLUMNS)]
    return "\n\n".join(sections) + "\n"


def paper_support(rows: Sequence[Row]) -> str:
    """Reason why the support `paper` has no limit, compared with the finest meshes of the rows."""
    growth = 100 * point_support_growth() / V_THEORY
    line = {row.n: row.error_percent for row in rows
            if (row.method, row.support) == ("fem_taylor_hood", "paper")}  # fmt: skip
    measured = ""
    if len(line) > 1:
        coarse, fine = sorted(line)[-2:]
        measured = (
            f" The Taylor-Hood solution grows by {line[fine] - line[coarse]:.3f} % from n = "
            f"{coarse} to {fine}."
        )
    return (
        "The support `paper` has no limit. The single point held at the root carries the whole "
        f"reaction P = {P:g} N, and under a point force the displacement of a plane body is "
        "infinite: it grows like ln(1/r). The grid cuts this off at r ~ h. Mirrored at the root, "
        "the force is Kelvin's force 2 P in a full plane, so every halving of h adds "
        "2 P (3 - 4 nu) ln 2 / (8 pi mu (1 - nu)) = "
        f"{point_support_growth():.4g} m to the deflection, asymptotically {growth:.2f} % of "
        f"v_theory.{measured} Errors of this support therefore do not measure a method. Compare "
        "methods on the same mesh, or on the support `exact`, whose limit is eq. (3)."
    )
