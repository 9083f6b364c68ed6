"""Run combinations of form, law, time and ranks on a small body; tabulate those that work.

python python/docs/compatibility.py            on the present ranks: JSON of every cell, for `table`

Static: a block on a smooth floor is compressed by 1 % in four steps; the forces of floor and top must be
opposite. Dynamic: a block stretches in free fall for three steps; its momentum must be m (v + g t). A
law with history must have flowed. Border: a pressure, a support on patches and an obstacle with friction
carry a block; their forces must be those of the closed form. Two ranks must give the same numbers.
"""

from __future__ import annotations

import json
import logging
import sys
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from mpi4py import MPI

import tawami
from tawami.form.files import shipped
from tawami.form.form import Form

E, NU, RHO, G = 1e6, 0.3, 1000.0, -9.81  # [Pa], [-], [kg/m3], [m/s2]
PRESSED, CELL = 0.01, 0.25  # [m], [m]
STEP = 1e-3  # [s]
CLAY = {"M": 1.0, "lambda_star": 0.1, "kappa_star": 0.02, "preconsolidation": 1e4}
TIMES = ("static", "dynamic")
#: Conditions on the border: name and time of their cells.
BORDER = ("pressure", "support on patches", "obstacle")
PRESSURE, GAP = 1e3, 0.3 * CELL  # [Pa], from the grid to a border off its edges [m]
#: Forms with their options, and bases.
FORMS: dict[str, dict[str, Any]] = {
    "u": {"form": "u"},
    "u_bbar": {"form": "u_bbar"},
    "u_p": {"form": "u_p"},
    "u_epsv": {"form": "u_epsv"},
    "u_epsv, residual_based": {"form": "u_epsv", "stabilisation": "residual_based"},
    "u_epsv, projection": {"form": "u_epsv", "stabilisation": "projection"},
    "u_epsv, ghost penalty": {"form": "u_epsv", "ghost_penalty": "on"},
    "u_epsv, bilinear": {"form": "u_epsv", "basis": "bilinear"},
    "u_epsv, biquadratic": {"form": "u_epsv", "basis": "biquadratic"},
    "u_finite": {"form": "u_finite"},
    "u_bbar_finite": {"form": "u_bbar_finite"},
    "u_epsv_finite": {"form": "u_epsv_finite"},
    "u_epsv_finite, ghost penalty": {"form": "u_epsv_finite", "ghost_penalty": "on"},
    "u_epsv_finite, bilinear": {"form": "u_epsv_finite", "basis": "bilinear"},
    **{
        f"{form}, axisymmetric": {"form": form, "geometry": "axisymmetric"}
        for form in ("u", "u_bbar", "u_p", "u_epsv", "u_finite", "u_bbar_finite", "u_epsv_finite")
    },
    # alpha in space and in time
    "u_epsv, alpha(x, y)": {"form": "u_epsv", "alpha": lambda x, y: 0.01 + 0.0 * x},
    "u_epsv, alpha(time)": {"form": "u_epsv", "alpha": lambda time: 0.01},
    **{
        form: {"form": form}
        for form in shipped()
        if form.startswith("u_epsv_") and form != "u_epsv_finite"
    },
}
#: Data of the forms that read some. The body is nearly impermeable, so that total forces are compared,
#: and no energy damages it.
DATA = {
    "kappa": 1e-12,  # [m2]
    "expansion": 1e-5,  # [1/K]
    "conductivity": 1.0,  # [W/(m K)]
    "capacity": 1e3,  # [J/(kg K)]
    "eta": 1e3,  # [Pa s]
    "H": 0.0,  # [J/m3]
    "G_c": 1.0,  # [J/m2]
    "l": 0.5,  # [m]
}


def _numpy_law() -> tawami.NumpyLaw:
    """Linear elasticity in NumPy."""
    K, mu = E / (3 * (1 - 2 * NU)), E / (2 * (1 + NU))
    one = np.array([1.0, 1.0, 1.0, 0.0])
    C = K * np.outer(one, one) + mu * (np.diag([2.0, 2.0, 2.0, 1.0]) - 2 / 3 * np.outer(one, one))

    def respond(strain: Any, stress: Any) -> tuple[Any, Any]:
        return stress + strain @ C, np.broadcast_to(C, (len(strain), 4, 4))

    return tawami.NumpyLaw(respond, K=K, mu=mu)


def _elastic() -> tawami.Material:
    return tawami.linear_elastic(E=E, nu=NU)


LAWS: dict[str, Callable[[], Any]] = {
    "linear_elastic": _elastic,
    "von_mises": lambda: tawami.von_mises(_elastic(), yield_stress=2e3),
    "drucker_prager": lambda: tawami.drucker_prager(_elastic(), phi=30.0, c=1e3),
    "mohr_coulomb": lambda: tawami.mohr_coulomb(_elastic(), phi=30.0, c=1e3),
    "cam_clay": lambda: tawami.cam_clay(_elastic(), **CLAY),
    "neo_hookean": lambda: tawami.neo_hookean(E=E, nu=NU),
    "NumpyLaw": _numpy_law,
}


@dataclass(frozen=True)
class Cell:
    """Result of a combination.

    Attributes:
        form, law, time: Keys of `FORMS` and `LAWS`, one of `TIMES`; or one of `BORDER` as the law, and
            "border" as the time.
        ranks: Number of ranks.
        error: Class of the exception; empty if the combination works.
        says: Message of the exception.
        numbers: Forces or momenta, mean of the stress, to compare with other numbers of ranks.
    """

    form: str
    law: str
    time: str
    ranks: int
    error: str = ""
    says: str = ""
    numbers: tuple[float, ...] = ()


def attempt(form: str, law: str, time: str) -> Cell:
    """Run one combination on the present ranks.

    Raises:
        AssertionError: It ran, but the numbers are wrong.
    """
    ranks = MPI.COMM_WORLD.size
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            if time == "border":
                numbers = _carry(form, law)
            else:
                scene = _block(form, law, moving=time == "dynamic")
                numbers = (_press if time == "static" else _fall)(scene, law)
    except tawami.TawamiError as error:
        return Cell(form, law, time, ranks, type(error).__name__, str(error))
    return Cell(form, law, time, ranks, numbers=numbers)


def _block(form: str, law: str, *, moving: bool, gap: float = 0.0) -> tawami.Scene:
    cells = (8, 8) if moving else (6, 6 if gap else 4)
    options = dict(FORMS[form])
    geometry = options.pop("geometry", "plane_strain")
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, -gap), h=CELL, cells=cells, geometry=geometry)
    low = 2 * CELL if moving else 0.0
    body = tawami.box(grid, (low, low), (low + 1, low + 1), per_axis=3, gauss=True)
    scene = tawami.Scene(grid, body, LAWS[law](), density=RHO, **options)
    for name in scene.form.data:
        scene.data(name, DATA[name])
    return scene


def _press(scene: tawami.Scene, law: str) -> tuple[float, ...]:
    """Forces of the floor and the top [N per metre depth, or N of the ring], mean stress [Pa]."""
    scene.fix("left", "x")
    scene.fix("bottom", "y")
    scene.fix("top", "y", -PRESSED)
    last: list[tawami.Solution] = []
    tawami.ramp(scene, 0.25, each=last.append, until=1.0)
    floor, top = (float(last[-1].reaction(edge)[1]) for edge in ("bottom", "top"))
    assert floor > 0, (law, floor)
    assert abs(floor + top) < 1e-4 * floor, (law, floor, top)
    _check_flow(scene, law)
    return floor, top, float(np.mean(last[-1].mean_stress))


def _fall(scene: tawami.Scene, law: str) -> tuple[float, ...]:
    """Momentum [kg m/s per metre depth, or kg m/s of the ring] and kinetic energy [J likewise]."""
    scene.gravity((0.0, G))
    ring = scene.grid.space.hoop
    stretch = 4.0 * (_positions(scene) - 1.0) + [0.0 if ring else 0.5, 0.0]
    motion = tawami.Dynamics(scene, velocity=stretch)
    motion.run(end=3 * STEP, dt=STEP)
    momentum = motion.linear_momentum
    mass = MPI.COMM_WORLD.allreduce(float(scene.mass.sum()))
    exact = [
        momentum[0] if ring else RHO * 0.5,
        mass * G * 3 * STEP,
    ]  # a ring has no radial momentum
    assert np.allclose(momentum, exact, atol=1e-6 * mass), (law, momentum)
    _check_flow(scene, law)
    return (*map(float, momentum), motion.kinetic_energy)


def _carry(form: str, condition: str) -> tuple[float, ...]:
    """Forces of a condition on the border [N per metre depth, or N of the ring], mean stress [Pa]."""
    scene = _block(
        form, "linear_elastic", moving=False, gap=0.0 if condition == "pressure" else GAP
    )
    scene.fix("left", "x")
    area = np.pi if scene.grid.space.hoop else 1.0
    exact, place = RHO * -G * area, "bottom"
    if condition == "pressure":
        scene.fix("bottom", "y")
        scene.pressure("top", PRESSURE)
        exact = PRESSURE * area
    else:
        scene.gravity((0.0, G))
        if condition == "obstacle":
            place = "floor"
            scene.obstacle(tawami.half_plane((0, 0), (0, 1)), 0.3, "bottom", name=place)
        else:
            scene.fix("bottom", "y")
    last: list[tawami.Solution] = []
    tawami.ramp(scene, 0.5, each=last.append, until=1.0)
    force = float(last[-1].reaction(place)[1])
    # at finite strain the pressure acts on the present length
    assert abs(force - exact) < (0.01 if condition == "pressure" else 1e-3) * exact, (form, force)
    return force, float(np.mean(last[-1].mean_stress))


def _positions(scene: tawami.Scene) -> Any:
    """Positions of all particles of the body, in its order, on every rank."""
    low = 2 * CELL
    return tawami.box(scene.grid, (low, low), (low + 1, low + 1), per_axis=3, gauss=True).x


def _check_flow(scene: tawami.Scene, law: str) -> None:
    if law in ("von_mises", "drucker_prager", "mohr_coulomb", "cam_clay"):
        flowed = float(np.max(scene.particles.history("plastic_strain"), initial=0.0))
        assert MPI.COMM_WORLD.allreduce(flowed, op=MPI.MAX) > 0, law


def difference(cells: Sequence[Cell]) -> float:
    """Largest relative difference of a combination between numbers of ranks.

    Raises:
        AssertionError: One rejected the combination and the other did not, or with another message.
    """
    largest = 0.0
    groups: dict[tuple[str, str, str], list[Cell]] = {}
    for cell in cells:
        groups.setdefault((cell.form, cell.law, cell.time), []).append(cell)
    for first, *others in groups.values():
        for other in others:
            assert (first.error, first.says) == (other.error, other.says), (first, other)
            scale = np.abs(first.numbers).max(initial=1e-300)
            off = np.abs(np.subtract(first.numbers, other.numbers)).max(initial=0.0)
            largest = max(largest, float(off / scale))
    return largest


def table(cells: Sequence[Cell], time: str, footnotes: dict[str, int]) -> str:
    """Markdown table of forms by laws; messages of rejected combinations become footnotes."""
    mine = {(c.form, c.law): c for c in cells if c.time == time}
    forms = list(dict.fromkeys(form for form, _ in mine))
    laws = list(dict.fromkeys(law for _, law in mine))
    lines = ["| form | kinematics | strain | " + " | ".join(f"`{law}`" for law in laws) + " |"]
    lines.append("|" + " --- |" * (3 + len(laws)))
    for name in forms:
        form = Form.load(FORMS[name]["form"])
        entries = [_entry(mine[name, law], footnotes) for law in laws]
        row = [f"`{FORMS[name]['form']}`" + name[len(FORMS[name]["form"]) :], form.kinematics.name]
        lines.append("| " + " | ".join([*row, form.strain.name, *entries]) + " |")
    return "\n".join(lines)


def _entry(cell: Cell, footnotes: dict[str, int]) -> str:
    if not cell.error:
        return "works"
    says = cell.says.replace(f"form '{FORMS[cell.form]['form']}'", "form '...'", 1)
    number = footnotes.setdefault(f"`{cell.error}`: {says}", len(footnotes) + 1)
    return f"rejected {number}"


def page(cells: Sequence[Cell], seconds: Mapping[int, float]) -> str:
    """The tables with their footnotes and the time they took."""
    footnotes: dict[str, int] = {}
    text = [
        f"## {time.capitalize()}\n\n{table(cells, time, footnotes)}" for time in (*TIMES, "border")
    ]
    text.append(
        "## Rejected combinations\n\n" + "\n".join(f"{n}. {says}" for says, n in footnotes.items())
    )
    works = sum(not cell.error for cell in cells)
    took = " and ".join(f"{s:.0f} s on {n} rank{'s' * (n > 1)}" for n, s in seconds.items())
    several = sum(cell.ranks > 1 for cell in cells)
    text.append(
        f"{len(cells)} combinations were run, {several} of them on 2 ranks (each form without options): "
        f"{works} work, {len(cells) - works} are rejected. This took {took}. Results of 1 and 2 ranks "
        f"differ by at most {difference(cells):.1e}, and they reject the same combinations."
    )
    return "\n\n".join(text) + "\n"


def main() -> None:
    """Run all combinations; on several ranks only forms without options."""
    logging.disable(logging.INFO)  # compiling forms logs much
    forms = [f for f in FORMS if MPI.COMM_WORLD.size == 1 or FORMS[f] == {"form": f}]
    cells = [attempt(f, law, time) for f in forms for law in LAWS for time in TIMES]
    plain = [f for f in forms if FORMS[f].keys() <= {"form", "geometry"}]
    cells += [attempt(f, one, "border") for f in plain for one in BORDER]
    if MPI.COMM_WORLD.rank == 0:
        json.dump([asdict(cell) for cell in cells], sys.stdout)


if __name__ == "__main__":
    tawami.run(main, "compatibility")
