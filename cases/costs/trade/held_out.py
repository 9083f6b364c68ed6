"""Limits of scenes that played no part when the rules of the error bars were chosen.

python -m cases.costs.trade.held_out
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import tawami
from cases.common.program import Program
from cases.costs.trade.coverage import LEAST, MIDDLE, widening
from cases.verification import ring, self_weight
from cases.verification.cantilever import mpm
from cases.verification.cantilever.beam import V_THEORY, L
from tawami.study.limit import limit_of, sizes_of


def lines() -> Iterator[tuple[str, Sequence[float], list[float], float]]:
    """Name, values of the knob, values of the quantity, exact value."""
    cells = (4, 8, 16, 32)
    for form in ("u", "u_bbar"):
        for axis in (2, 3):
            beams = [mpm.build(form, "exact", n, per_axis=axis).solve() for n in cells]
            tips = [-float(beam.displacement((L, 0.0))[1]) for beam in beams]
            yield f"beam, {form}, {axis} x {axis}", cells, tips, V_THEORY
    sizes = (5.0, 2.5, 1.25, 0.625)
    for form in ("u_epsv_finite", "u_bbar_finite"):
        heights = [self_weight.solve(form, h=h, increments=10).height for h in sizes]
        yield f"column, {form}", sizes, heights, self_weight.final_height()
    cells = (4, 6, 8, 12)
    for shift in ring.SHIFTS[1:]:
        found = []
        for n in cells:
            law = tawami.linear_elastic(E=ring.E, nu=ring.NU)
            scene, _, _ = ring.build(n, ring.B + 2 / n, shift, law, False, volumes="fitted")
            scene.pressure("inner", ring.P)
            place = (MIDDLE + shift[0] / n, shift[1] / n)
            found.append(float(scene.solve().displacement(place)[0]))
        yield f"ring, shift {shift}", cells, found, widening()


PROGRAM = Program("cases.costs.trade.held_out", __doc__, files=False)


def main(arguments: Sequence[str] | None = None) -> None:
    """Print covered settings of each line."""
    PROGRAM.start(arguments)
    for name, knob, values, exact in lines():
        limit = limit_of(sizes_of(knob), values)
        least = LEAST * abs(exact)
        bars = [(abs(v - exact), abs(v - limit.value)) for v in values]
        covered = sum(abs(true - e) <= limit.uncertainty + least for true, e in bars)
        narrow = sum(e + limit.uncertainty <= 3 * true + least for true, e in bars)
        text = f"covered {covered}, narrow {narrow} of {len(values)}"
        print(f"{name}: {text if limit.exists else 'no limit, wrongly'}")


if __name__ == "__main__":
    PROGRAM.run(main)
