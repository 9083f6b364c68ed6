"""A rigid pile with a round tip that is pressed into clay and into sand, at finite strain.

    axis | B/2 |
         |     |  w         one half, B = 1 m, plane strain, smooth; the tip is a half circle
     o   |    /             the ground: 5 m x 5 m, without weight
     o    `--'_________o    left and right edge smooth, bottom held
     o                 o    clay: von Mises, s_u = 1 kPa, mu = 100 s_u, nu = 0.499
     o______ soil _____o    sand: Mohr-Coulomb, phi = 30 deg, psi = 5 deg, mu = 100 q, nu = 0.3

Clay flows at constant volume and heaves next to the tip. Merifield, White and Randolph (2009,
J. Geotech. Geoenviron. Eng. 135, 819) fit finite element results with heave, for a smooth cylinder of
diameter B, by the force

    Q = 5.3 s_u B (w/B)^(1/4).

Sand is under a surcharge q = 1 kPa, on the whole border, with the same pressure in all directions at the
start; c = 0.05 q. Where the ground fails around a cavity, as far below a deep pile, the pressure on the
tip is the limit pressure p of Yu and Houlsby (1991, Geotechnique 41, 173), and the force above the
surcharge

    Q = (p - q) b,    b = 2 B sqrt(w/B - (w/B)^2) or B, the width of the tip at the surface.

A footing on level ground of this width b carries more, as its base is level. Prandtl (1920) and, on
sand, Reissner (1924), with N_q = exp(pi tan phi) tan^2(45 deg + phi/2) and, as psi < phi, Davis's
reduced phi and c (`bearing_capacity`):

    Q = (2 + pi) s_u b   on clay,    Q = (N_q - 1) (q + c/tan phi) b   on sand.

On sand these are no bounds, but estimates: of a deep tip, and of a rigid soil with a level surface.
Near nu = 0.5 the ground locks without a mixed form or B-bar, and the force is too large.

The pile is a rigid obstacle without friction, and the steps are static. Contact acts on means over
patches of the border, about as long as a cell, so that it starts when the tip is h^2/(3 B) deep. The
force jumps by up to 2 UNIT B where patches of a stretched border are replaced.

Errors of the force at w = B/4, with four cells over B [%]:

    form                clay: cylinder, footing    sand: cavity, footing
    mixed                        9,      -8                33,    -20
    B-bar                        0,     -15                40,    -16
    displacement only           51,      27                34,    -19

In clay B-bar ends at 0.28 B, where particles turn inside out. Drained sand, nu = 0.3, does not lock.
With `--depth 2` the mixed form reaches 2 B in both soils (B/h = 4); displacement only ends at 1.08 B in
clay, and at 1.9 B in sand.

python -m cases.verification.penetration
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from scipy.integrate import quad
from scipy.optimize import brentq

import tawami
from cases.common.figure import COLOURS, save
from cases.common.ground import ground
from cases.common.program import Program
from cases.common.table import as_csv, as_text
from cases.verification.bearing_capacity import davis
from tawami.picture import style

Array = npt.NDArray[np.float64]

B, CORE = 1.0, 0.01  # width of the pile, half the width of its flat end [m]
WIDTH, DEPTH, ROOM = 5, 5, 1  # of the ground, and above it [m]
UNIT, RIGIDITY = 1.0e3, 100.0  # s_u of the clay, surcharge q of the sand [Pa]; mu over it [-]
NU = {"clay": 0.499, "sand": 0.3}  # [-]
PHI, PSI, C = 30.0, 5.0, 50.0  # of the sand [deg, deg, Pa]
W = 1.0  # depth of the tip at the end, over B
COMPARED = 0.25  # depth at which the forces are compared, over B
FORMS = {
    "u_epsv_finite": "mixed $u$-$\\varepsilon_v$",
    "u_bbar_finite": "B-bar",
    "u_finite": "displacement only",
}


def chord(w: npt.ArrayLike) -> Array:
    """Width of the tip at the surface over B, at a depth over B."""
    w = np.minimum(w, 0.5)
    return np.asarray(2 * np.sqrt(w - w**2))


def cavity(phi: float, psi: float, c: float, mu: float, nu: float, p0: float) -> float:
    """Limit pressure of a cylindrical cavity in Mohr-Coulomb soil [Pa].

    Yu and Houlsby (1991), with logarithmic strains in the plastic annulus r < 1 and pressures positive.
    Stress: r s_r' + s_r - s_t = 0 and s_r = a s_t + Y. Flow: the sum d e_r + e_t is elastic, with
    e_r = ln(dr0/dr) and e_t = ln(r0/r), which gives r0(r). The cavity begins at r0 = 0.

    Args:
        phi, psi: Angles of friction and of dilatancy [deg].
        c: Cohesion [Pa].
        mu: Shear modulus [Pa].
        nu: Poisson's ratio.
        p0: Pressure at the start [Pa].
    """
    of_phi, of_psi = np.sin(np.radians([phi, psi]))
    a, d = (1 + of_phi) / (1 - of_phi), (1 + of_psi) / (1 - of_psi)
    Y = 2 * c * np.cos(np.radians(phi)) / (1 - of_phi)
    tension = Y / (a - 1)
    border = 2 * (a * (p0 + tension)) / (1 + a)  # s_r + tension, at r = 1

    def radial(r: float) -> float:
        return float(border * r ** ((1 - a) / a) - tension)

    def elastic(r: float) -> float:
        s_r, s_t = radial(r) - p0, (radial(r) - Y) / a - p0
        return float(d * ((1 - nu) * s_r - nu * s_t) + (1 - nu) * s_t - nu * s_r) / (2 * mu)

    def volume(r: float) -> float:
        """Soil between r and 1, less that between r0 = 0 and the border at the start."""
        now = quad(lambda x: x ** (1 / d) * np.exp(elastic(x) / d), r, 1.0)[0]
        at_start = 1 - (radial(1.0) - p0) / (2 * mu)
        return float(now - at_start ** (1 + 1 / d) / (1 + 1 / d))

    return radial(brentq(volume, 1e-3, 1.0))


def cylinder(w: npt.ArrayLike) -> Array:
    """Force over s_u B of a smooth cylinder in clay at a depth over B."""
    return np.asarray(5.3 * np.asarray(w) ** 0.25)


def footing(w: npt.ArrayLike, soil: str) -> Array:
    """Force over B UNIT of a footing as wide as the tip at the surface."""
    if soil == "clay":
        return (2 + np.pi) * chord(w)
    return davis(PHI, PSI, C / UNIT + np.tan(np.radians(PHI))) * chord(w)


def smooth(w: npt.ArrayLike, soil: str) -> Array:
    """Force over B UNIT of a cylinder in clay, or with the limit pressure of a cavity in sand."""
    if soil == "clay":
        return cylinder(w)
    p = cavity(PHI, PSI, C, RIGIDITY * UNIT, NU["sand"], UNIT)
    return (p / UNIT - 1) * chord(w)


@dataclass(frozen=True)
class Run:
    """Penetration of a pile.

    Attributes:
        soil: 'clay' or 'sand'.
        form: Weak form.
        n: Cells over B.
        depth: Depth of the tip at the end, over B.
        q: Force at the depth COMPARED, over UNIT B.
        smooth, footing: Its errors against the cylinder or cavity, and against the footing [%].
        iterations, most: Newton iterations per step, mean and largest number.
        penetration: Deepest mean of a patch of the border in the pile at the end, over B.
        w, force: Depths over B and forces over UNIT B, at the start and after each step.
        x, border, plastic: Particles and points of the border [m] and plastic strain at the end.
        stopped: Reason why the run ended early; empty if it did not.
    """

    soil: str
    form: str
    n: int
    depth: float
    q: float
    smooth: float
    footing: float
    iterations: float
    most: int
    penetration: float
    w: Array
    force: Array
    x: Array
    border: Array
    plastic: Array
    stopped: str


COLUMNS = (
    "soil", "form", "n", "depth", "q", "smooth", "footing", "iterations", "most", "penetration"
)  # fmt: skip


def build(soil: str, form: str, n: int) -> tawami.Scene:
    """The ground in equilibrium, before the pile touches it."""
    nu = NU[soil]
    elastic = tawami.linear_elastic(E=2 * RIGIDITY * UNIT * (1 + nu), nu=nu)
    law: Any
    if soil == "clay":
        law = tawami.von_mises(elastic, yield_stress=np.sqrt(3) * UNIT)
    else:
        law = tawami.mohr_coulomb(elastic, phi=PHI, psi=PSI, c=C)
    scene = ground(B / n, (0.0, WIDTH), DEPTH, law, room=ROOM, per_axis=3, form=form)
    if soil == "sand":
        scene.initial("stress", (-UNIT, -UNIT, -UNIT, 0.0))
        scene.pressure("top", UNIT)
        scene.solve()
    return scene


def solve(soil: str, form: str, n: int = 4, w: float = W, step: float = 0.02) -> Run:
    """Press the pile into the ground.

    Args:
        soil: 'clay' or 'sand'.
        form: Weak form of finite strain.
        n: Cells over B.
        w: Depth of the tip at the end, over B.
        step: Largest step of the depth, over B.
    """
    scene, radius = build(soil, form, n), B / 2 - CORE
    corners = [(-CORE, radius), (CORE, radius), (CORE, 2 * B), (-CORE, 2 * B)]
    tip = tawami.rigid_polygon(corners, radius=radius)
    pile = scene.obstacle(tip, where="top", displacement=(0.0, -w * B))
    start = pile.x[1]
    rows, iterations, inside = [(0.0, 0.0)], [0], [0.0]

    def each(solution: tawami.Solution) -> None:
        contact = solution.contact(pile)
        rows.append(((start - pile.x[1]) / B, 2 * contact.force[1] / (UNIT * B)))
        iterations.append(solution.iterations)
        inside.append(contact.penetration / B)

    stopped = ""
    try:
        tawami.ramp(scene, step / w, each=each, stop="raise")
    except tawami.ConvergenceError as error:
        stopped = str(error)
    depth, force = np.transpose(rows)
    q = float(np.interp(COMPARED, depth, force, right=np.nan))
    errors = [100 * (q / float(exact(COMPARED, soil)) - 1) for exact in (smooth, footing)]
    return Run(
        soil, form, n, float(depth[-1]), q, *errors, float(np.mean(iterations[1:])),
        max(iterations), inside[-1], depth, force,
        np.array(scene.particles.x), np.array(scene.border.x),
        np.array(scene.particles.history("plastic_strain")), stopped,
    )  # fmt: skip


def draw_forces(axes: Axes, runs: Sequence[Run]) -> None:
    """Draw the forces in one soil over the depth."""
    soil, w = runs[0].soil, np.linspace(0, max(run.depth for run in runs), 200)
    label = {"clay": "smooth cylinder", "sand": "cavity as wide as the tip"}[soil]
    axes.plot(smooth(w, soil), w, "k", label=label)
    axes.plot(footing(w, soil), w, "k--", linewidth=0.8, label="footing as wide as the tip")
    for run in runs:
        label = f"{FORMS[run.form]}, B/h = {run.n}"
        axes.plot(run.force, run.w, ".-", color=COLOURS[run.form], markersize=4, label=label)
    axes.invert_yaxis()
    axes.set_title(soil)
    axes.set_xlabel(f"force $Q / ({'s_u' if soil == 'clay' else 'q'} B)$ [-]")
    axes.set_ylabel("depth of the tip $w / B$ [-]")
    axes.grid()
    axes.legend()


def draw_ground(axes: Axes, run: Run) -> None:
    """Draw the plastic strain around the pile at the end."""
    shown = axes.scatter(
        *run.x.T, c=run.plastic, s=90 / run.n, cmap=style.FROM_ZERO, vmin=0, vmax=1
    )
    top = run.border[:, 1] > -run.depth * B - 0.1
    axes.plot(*run.border[top & (run.border[:, 0] > 0)].T, ".", color="k", markersize=3)
    turn = np.linspace(-np.pi / 2, 0, 100)
    tip = B / 2 - run.depth * B
    outline = np.column_stack([B / 2 * np.cos(turn), tip + B / 2 * np.sin(turn)])
    axes.plot(*np.vstack([outline, [B / 2, 2 * B]]).T, "k", linewidth=0.8)
    axes.set(xlim=(0, 2), ylim=(-0.5 - run.depth * B, 0.5), aspect="equal")
    axes.set(xlabel="$x$ [m]", ylabel="$y$ [m]")
    axes.set_title(f"{run.soil}, {FORMS[run.form]}")
    axes.figure.colorbar(shown, ax=axes, label="plastic strain [-]")


def draw(runs: Sequence[Run], path: Path) -> None:
    """Draw the forces in each soil, and the ground of its first run at the end."""
    soils = list(dict.fromkeys(run.soil for run in runs))
    figure, panels = plt.subplots(
        len(soils), 2, figsize=(11, 4.6 * len(soils)), layout="constrained", squeeze=False
    )
    for (left, right), soil in zip(panels, soils, strict=True):
        mine = [run for run in runs if run.soil == soil]
        draw_forces(left, mine)
        draw_ground(right, mine[0])
    save(figure, path)


PROGRAM = Program("cases.verification.penetration", __doc__)
PROGRAM.option("--cells", type=int, default=4, help="cells over the width B of the pile")
PROGRAM.option("--depth", type=float, default=W, help="depth of the tip at the end, over B")


def main(arguments: Sequence[str] | None = None) -> None:
    """Press the pile with each form, print the table, draw the figure."""
    options = PROGRAM.start(arguments)
    runs = [solve(soil, form, options.cells, options.depth) for soil in NU for form in FORMS]
    print(as_text(runs, COLUMNS))
    for run in runs:
        if run.stopped:
            print(f"{run.form} ended in {run.soil} at w = {run.depth:.3g} B: {run.stopped}")
    PROGRAM.write("table.csv", as_csv(runs, COLUMNS))
    draw(runs, PROGRAM.folder / "penetration.png")
    PROGRAM.list_results()


if __name__ == "__main__":
    PROGRAM.run(main)
