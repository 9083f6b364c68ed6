"""Bodies of 1e-6 m to 1e4 m, and other units: the results must agree once the units are removed.

A beam under a load on its edge, a strip of Drucker-Prager material beyond yield, and dynamic steps at
finite strain. All data are multiplied by powers of the units of length, stress and time.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

import tawami
from cases.extremes.attempt import Attempt, attempted

Array = npt.NDArray[np.float64]
SUBJECT = "scales and units"


@dataclass(frozen=True)
class Units:
    """Values of a metre, a pascal and a second in the new units."""

    metre: float = 1.0
    pascal: float = 1.0
    second: float = 1.0

    @property
    def kg_per_m3(self) -> float:
        """Value of a kg/m3 in the new units, as Pa s2/m2."""
        return self.pascal * self.second**2 / self.metre**2


SETTINGS = {
    "a body of 1e-6 m": Units(metre=1e-6),
    "a body of 1e-3 m": Units(metre=1e-3),
    "a body of 1e4 m": Units(metre=1e4),
    "mm, kPa": Units(metre=1e3, pascal=1e-3),
    "mm, MPa": Units(metre=1e3, pascal=1e-6),
    "m, GPa": Units(pascal=1e-9),
    "um, GPa, us": Units(metre=1e6, pascal=1e-9, second=1e6),
    "km, Pa, year": Units(metre=1e-3, second=1 / 3.15e7),
    "soft: 1e-6 of the stiffness": Units(pascal=1e-6),
    "stiff: 1e9 of the stiffness": Units(pascal=1e9),
}
#: Forms and Poisson's ratios. Without a field for the volume the condition number grows with K/mu.
ELASTIC = {"u": 0.3, "u_bbar": 0.3, "u_epsv": 0.4999, "u_p": 0.4999}


def strip(units: Units, law: tawami.Material, form: str, **options: Any) -> tawami.Scene:
    """A strip of 2 m x 1 m, 8 x 4 cells, held on the left."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0.0, 0.0), h=0.25 * units.metre, cells=(8, 4))
    scene = tawami.Scene(
        grid, tawami.box(grid, grid.origin, grid.upper, per_axis=2), law, form=form, **options
    )
    scene.fix("left", "x")
    scene.fix("left", "y")
    return scene


def numbers(scene: tawami.Scene, units: Units) -> list[Array]:
    """Displacement [m] and stress [Pa] of the particles."""
    particles = scene.particles
    return [particles.displacement / units.metre, particles.stress / units.pascal]


def beam(units: Units, form: str) -> list[Array]:
    """Displacement, stress and reaction of an elastic beam."""
    law = tawami.linear_elastic(E=3e6 * units.pascal, nu=ELASTIC[form])
    scene = strip(units, law, form)
    scene.traction("right", (0.0, -1e3 * units.pascal))
    solution = scene.solve()
    force = solution.reaction("left") / (units.pascal * units.metre)
    return [*numbers(scene, units), force]


def pressed(units: Units) -> list[Array]:
    """Displacement, stress and plastic strain of Drucker-Prager material beyond yield."""
    elastic = tawami.linear_elastic(E=1e6 * units.pascal, nu=0.3)
    law = tawami.drucker_prager(elastic, phi=30.0, c=1e3 * units.pascal, psi=5.0)
    scene = strip(units, law, "u_epsv")
    scene.fix("bottom", "y")
    scene.traction("right", (-3.3e3 * units.pascal, 0.0))
    scene.solve()
    strain = np.array(scene.particles.history("plastic_strain"))
    assert (strain > 0).any()  # otherwise this is only the beam again
    return [*numbers(scene, units), strain]


def dropped(units: Units) -> list[Array]:
    """Displacement, stress and velocity of a cantilever after six steps under its weight."""
    law = tawami.linear_elastic(E=1e6 * units.pascal, nu=0.3)
    scene = strip(units, law, "u_epsv_finite", density=1e3 * units.kg_per_m3)
    scene.gravity((0.0, -10 * units.metre / units.second**2))
    motion = tawami.Dynamics(scene)
    motion.run(0.03 * units.second, 0.005 * units.second)
    return [*numbers(scene, units), motion.velocity * units.second / units.metre]


def difference(run: Callable[[Units], list[Array]], units: Units) -> float:
    """Largest change of a quantity over its largest value."""
    pairs = zip(run(units), run(Units()), strict=True)
    return max(float(np.abs(new - old).max() / np.abs(old).max()) for new, old in pairs)


def attempts(short: bool) -> Iterator[Attempt]:
    """Each problem in each setting. The bound 1e-9 exceeds round-off times the condition number."""
    runs: dict[str, Callable[[Units], list[Array]]] = {
        f"beam, {form}": lambda units, form=form: beam(units, form) for form in ELASTIC
    }
    runs |= {"Drucker-Prager": pressed, "dynamic step": dropped}
    for name, run in runs.items():
        for setting, units in list(SETTINGS.items())[:: 4 if short else 1]:
            yield attempted(
                SUBJECT, f"{name}: {setting}", 1e-9, lambda r=run, u=units: difference(r, u)
            )
