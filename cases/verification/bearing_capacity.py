"""The bearing capacity of a strip footing on weightless frictional soil, by loading to collapse.

    pressure q over b = 1 m
     |||||||||||||                         one half; width B = 2 b, plane strain
     o                               o     left and right edge smooth, bottom held
     o            soil               o     c = 1 Pa, mu = 500 c, nu = 0.3 to 0.4999
     o_______________________________o     Mohr-Coulomb or Drucker-Prager, phi, psi

Prandtl 1921 (Z. angew. Math. Mech. 1, 15): the traction at collapse is

    q = c (exp(pi tan phi) tan^2(45 deg + phi/2) - 1) / tan phi,    (2 + pi) c for phi = 0.

It is exact for associated flow, psi = phi. With psi < phi there is no limit theorem and no unique limit
load. Davis 1968 (in Soil Mechanics: Selected Topics) treats the soil as associated, with the reduced

    tan phi* = r tan phi,  c* = r c,    r = cos psi cos phi / (1 - sin psi sin phi),

which is a low estimate. The loads measured here lie between Davis's and Prandtl's value where psi is far
below phi, and depend by a few percent on the steps.

The load grows in adaptive steps until no equilibrium is found; the share reached is the result.
The domain contains the mechanism. The pressure acts on the border of the ground over exactly x < b.
Drucker-Prager's constants match those of Mohr-Coulomb in plane strain.

python -m cases.verification.bearing_capacity
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from time import perf_counter

import numpy as np

import tawami
from cases.common.ground import ground
from cases.common.program import Program, progress
from cases.common.table import as_csv, as_text

RIGIDITY, C = 500.0, 1.0  # mu/c [-], cohesion [Pa]
HIGHEST = 1.5  # load of a complete ramp, over Prandtl's
#: Width and depth of the ground by phi [deg], in units of b.
GROUND = {0: (4, 2), 20: (6, 3), 30: (11, 5)}
LAWS = {"mohr_coulomb": tawami.mohr_coulomb, "drucker_prager": tawami.drucker_prager}
COLUMNS = (
    "form", "law", "phi", "psi", "nu", "n", "q", "error", "over_davis", "steps", "iterations", "seconds"
)  # fmt: skip


def prandtl(phi: float, c: float = C) -> float:
    """Traction at collapse [Pa] for a friction angle [deg]."""
    if phi == 0:
        return float((2 + np.pi) * c)
    tan = np.tan(np.radians(phi))
    passive = np.tan(np.radians(45 + phi / 2)) ** 2
    return float(c * (np.exp(np.pi * tan) * passive - 1) / tan)


def davis(phi: float, psi: float, c: float = C) -> float:
    """Low estimate of the traction at collapse with psi < phi [Pa]; Prandtl's for psi = phi."""
    of_phi, of_psi = np.radians(phi), np.radians(psi)
    r = np.cos(of_psi) * np.cos(of_phi) / (1 - np.sin(of_psi) * np.sin(of_phi))
    return prandtl(float(np.degrees(np.arctan(r * np.tan(of_phi)))), float(r) * c)


def dilatancies(phi: float) -> list[float]:
    """Angles of dilatancy of the study for a friction angle [deg]."""
    return sorted({0.0, phi / 2, float(phi)})


@dataclass
class Run:
    """A loading to collapse.

    Attributes:
        law: Material, a key of `LAWS`.
        phi, psi: Angles of friction and of dilatancy [deg].
        nu: Poisson's ratio.
        n: Cells over half the footing: B/h = 2 n.
        form: Weak form.
        q: Traction at collapse [Pa]; infinite if the whole load was borne.
        steps: Number of accepted steps.
        iterations: Newton iterations per accepted step.
        seconds: Wall time.
    """

    law: str
    phi: int
    psi: float
    nu: float
    n: int
    form: str = "u_epsv"
    q: float = np.nan
    steps: int = 0
    iterations: float = np.nan
    seconds: float = 0.0

    @property
    def error(self) -> float:
        """Error of q against Prandtl's [%]."""
        return 100 * (self.q / prandtl(self.phi) - 1)

    @property
    def over_davis(self) -> float:
        """Error of q against Davis's estimate [%]."""
        return 100 * (self.q / davis(self.phi, self.psi) - 1)


def build(run: Run) -> tawami.Scene:
    """The ground, with `HIGHEST` times Prandtl's traction on the footing."""
    width, depth = GROUND[run.phi]
    elastic = tawami.linear_elastic(E=2 * RIGIDITY * C * (1 + run.nu), nu=run.nu)
    soil = LAWS[run.law](elastic, phi=run.phi, psi=run.psi, c=C)
    parameters = {"alpha": 0.1} if run.form == "u_epsv" else {}
    scene = ground(1 / run.n, (0.0, width), depth, soil, per_axis=3, form=run.form, **parameters)
    scene.pressure(lambda x, y: (y == 0) & (x < 1), HIGHEST * prandtl(run.phi))
    return scene


def solve(
    law: str, phi: int, psi: float, nu: float, n: int, form: str = "u_epsv", step: float = 0.05
) -> Run:
    """Load the footing until it collapses, in steps of at most the share `step` of the load."""
    begin = perf_counter()
    run = Run(law, phi, psi, nu, n, form)
    iterations: list[int] = []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", tawami.IncompleteWarning)  # the end is the result
        steps = tawami.ramp(
            build(run), step, each=lambda solution: iterations.append(solution.iterations)
        )
    run.q = np.inf if steps.complete else steps.reached * HIGHEST * prandtl(phi)
    run.steps, run.iterations = len(iterations), float(np.mean(iterations))
    run.seconds = perf_counter() - begin
    return run


PROGRAM = Program("cases.verification.bearing_capacity", __doc__)
PROGRAM.option("--cells", type=int, default=8, help="most cells over half the footing")


def main(arguments: Sequence[str] | None = None) -> None:
    """Run all laws, angles and Poisson's ratios, and print the table."""
    options = PROGRAM.start(arguments)
    work = [
        (law, phi, psi, nu, 2)
        for law, phi, nu in product(LAWS, GROUND, (0.3, 0.45, 0.49, 0.4999))
        for psi in dilatancies(phi)
    ]
    work += [
        (law, phi, psi, 0.49, 4) for law, phi in product(LAWS, GROUND) for psi in dilatancies(phi)
    ]
    work += [("mohr_coulomb", 20, 20.0, 0.49, 8)]
    work = [one for one in work if one[-1] <= options.cells]
    rows = [solve(*one) for one in progress(work, desc="bearing capacity")]
    rows.append(solve("mohr_coulomb", 20, 20.0, 0.49, 2, form="u"))
    print(as_text(rows, COLUMNS))
    PROGRAM.write("table.csv", as_csv(rows, COLUMNS))
    PROGRAM.list_results()


if __name__ == "__main__":
    PROGRAM.run(main)
