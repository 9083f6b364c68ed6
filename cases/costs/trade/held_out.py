"""Error bars on scenes that played no part when their rules were chosen.

Shapes, laws, geometries and quantities differ from those of `cases.costs.trade.coverage`: a thick
sphere, rings with other laws and shifts, compressible bending, Mandel's slab, a heated wall, creep, a
frequency.
The rules in `tawami.study.limit` were fixed before the first run of these lines.

python -m cases.costs.trade.held_out
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from mpi4py import MPI

import tawami
from cases.common.program import Program
from cases.common.table import as_text
from cases.costs.trade.coverage import LEAST
from cases.verification import consolidation, creep, heated_wall, ring
from cases.verification.cantilever import beam, mpm
from tawami.study.limit import limit_of, sizes_of

#: Modulus [Pa], Poisson's ratio and inner pressure [Pa] of the sphere; its radii are those of the ring.
E, NU, P = 1.0e4, 0.3, 10.0


def sphere(n: int) -> float:
    """Radial displacement in the middle of the wall of a thick sphere [m]."""
    size = ring.B + 2 / n
    cells = int(np.ceil(size * n))
    grid = tawami.Grid(
        MPI.COMM_WORLD, origin=(0.0, -cells / n), h=1 / n, cells=(cells, 2 * cells),
        geometry="axisymmetric",
    )  # fmt: skip
    wall = tawami.disc(grid, (0.0, 0.0), ring.B, inner=ring.A)
    scene = tawami.Scene(grid, wall, tawami.linear_elastic(E=E, nu=NU), form="u_epsv")
    scene.pressure("inner", P)
    scene.hold((1.5, 0.0), "y")
    return float(scene.solve().displacement((1.5, 0.0))[0])


def sphere_exact() -> float:
    """Lamé's displacement of the sphere at r = 1.5 m."""
    a, b, r = ring.A, ring.B, 1.5
    return P * a**3 / (E * (b**3 - a**3)) * ((1 - 2 * NU) * r + (1 + NU) * b**3 / (2 * r**2))


def compressible_ring(n: int) -> float:
    """Displacement in the middle of the wall of a ring [m]: displacement only, nu = 0.3, shifted."""
    shift = (0.25, 0.55)
    law = tawami.linear_elastic(E=ring.E, nu=NU)
    scene, _, _ = ring.build(n, ring.B + 2 / n, shift, law, False, form="u")
    scene.pressure("inner", ring.P)
    return float(scene.solve().displacement((1.5 + shift[0] / n, shift[1] / n))[0])


def compressible_ring_exact() -> float:
    """Lamé's displacement of the ring at r = 1.5 m."""
    a, b, r = ring.A, ring.B, 1.5
    factor = ring.P * a**2 * (1 + NU) / (ring.E * (b**2 - a**2))
    return factor * ((1 - 2 * NU) * r + b**2 / r)


def stretched_ring(n: int) -> float:
    """Inner radius of a shifted ring of rubber at large strain [m]."""
    return 2 * ring.A * (1 + ring.large(n, (0.2, 0.3)).radius / 100)


def bent(n: int) -> float:
    """Tip deflection of the cantilever with nu = 0.3 [m]."""
    solution = mpm.build("u_epsv", "exact", n, nu=0.3, per_axis=3).solve()
    return -float(solution.displacement((beam.L, 0.0))[1])


def slab(n: int) -> float:
    """Force of Mandel's plate over F at T = 0.1, with steps proportional to h."""
    return consolidation.mandel(n, 4e-3 / n, 0.1, 0.8 / n, 0.16 / n).force[-1]


def wall(n: int) -> float:
    """Movement of the heated wall at T = 0.3 [mm], with steps proportional to h."""
    (state,) = [state for state in heated_wall.solve(n, 10 * n) if state.T == 0.3]
    return state.moved


def crept(steps: int) -> float:
    """Shear strain of Kelvin and Voigt's block at its release, over tau/mu."""
    return creep.solve(steps).at_release


def frequency(n: int) -> float:
    """Lowest frequency of a column of uniaxial strain with a free top [Hz]; M = 1 Pa, rho = 1, H = 1."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0.0, 0.0), h=1 / n, cells=(1, n))
    body = tawami.box(grid, (0.0, 0.0), (1 / n, 1.0))
    law = tawami.linear_elastic(E=1.0, nu=0.0)
    scene = tawami.Scene(grid, body, law, form="u", density=1.0)
    for edge, component in (("left", "x"), ("right", "x"), ("bottom", "y")):
        scene.fix(edge, component)
    return float(tawami.modes(scene, 1).frequencies[0])


#: Function of a knob, values of the knob from coarse to fine, exact value.
LINES: dict[str, tuple[Callable[[Any], float], Sequence[float], float]] = {
    "thick sphere": (sphere, (4, 6, 8, 12), sphere_exact()),
    "ring, displacement only": (compressible_ring, (4, 6, 8, 12), compressible_ring_exact()),
    "ring, large strain": (stretched_ring, (4, 6, 8, 10), 2 * ring.A),
    "cantilever, nu = 0.3": (bent, (4, 8, 16, 32), beam.deflection(0.3)),
    "Mandel": (slab, (4, 8, 12, 16), 1.0),
    "heated wall": (wall, (4, 8, 16, 32), 1e3 * heated_wall.movement(0.3)),
    "creep": (crept, (6, 12, 24, 48), creep.exact(creep.RELEASE)),
    "frequency": (frequency, (4, 8, 16, 32), 0.25),
}


@dataclass(frozen=True)
class Row:
    """A line: error of the finest value, of the limit, its uncertainty [%]; settings and their bars."""

    line: str
    finest: float
    limit: float
    uncertainty: float
    settings: int
    covered: int
    narrow: int


COLUMNS = ("line", "finest", "limit", "uncertainty", "settings", "covered", "narrow")


def judged(name: str) -> Row:
    """Values, limit and bars of a line."""
    function, knob, exact = LINES[name]
    values = [function(value) for value in knob]
    limit, least = limit_of(sizes_of(knob), values), LEAST * abs(exact)
    bars = [(abs(v - exact), abs(v - limit.value)) for v in values]
    covered = sum(abs(true - e) <= limit.uncertainty + least for true, e in bars)
    narrow = sum(e + limit.uncertainty <= 3 * true + least for true, e in bars)
    errors = (100 * (value / exact - 1) for value in (values[-1], limit.value))
    uncertainty = 100 * limit.uncertainty / abs(exact)
    return Row(name, *errors, uncertainty, len(values), covered if limit.exists else 0, narrow)


PROGRAM = Program("cases.costs.trade.held_out", __doc__, files=False)


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the bars of all lines."""
    PROGRAM.start(arguments)
    print(as_text([judged(name) for name in LINES], COLUMNS))


if __name__ == "__main__":
    PROGRAM.run(main)
