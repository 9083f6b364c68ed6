"""A rigid pile with a round tip that is pressed into clay, at finite strain.

    axis | B/2 |
         |     |  w         one half, B = 1 m, plane strain, smooth; the tip is a half circle
     o   |    /             the ground: 4 m x 5 m, weightless clay
     o    `--'_________o    left and right edge smooth, bottom held
     o                 o    von Mises, s_u = 1 kPa, mu = 100 s_u, nu = 0.499
     o______ clay _____o

The ground flows at constant volume and heaves next to the tip. Merifield, White and Randolph (2009,
J. Geotech. Geoenviron. Eng. 135, 819) fit finite element results with heave, for a smooth cylinder of
diameter B, by the force

    Q = 5.3 s_u B (w/B)^(1/4).

A footing on level ground as wide as the chord of the tip carries more, as its base is level:

    Q = (2 + pi) s_u B 2 sqrt(w/B - (w/B)^2).

Without a mixed form or B-bar the ground locks, and the force is too large. The pile is a rigid obstacle
without friction, and the steps are static. Contact acts on means over patches of the border, about as
long as a cell, so that it starts when the tip is h^2/(3 B) deep.

With four cells over B the mixed form reaches 2 B (--depth 2) and B-bar ends before 1 B. Beyond 0.7 B the
force of the mixed form jumps by up to 0.9 s_u B, as patches of the border are replaced.

python -m cases.verification.penetration
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import numpy.typing as npt
from mpi4py import MPI

import tawami
from cases.common.figure import COLOURS, save
from cases.common.program import Program
from cases.common.table import as_csv, as_text
from tawami.picture import style

Array = npt.NDArray[np.float64]

B, CORE = 1.0, 0.01  # width of the pile, half the width of its flat end [m]
WIDTH, DEPTH, ROOM = 4, 5, 1  # of the ground, and above it [m]
S_U, RIGIDITY, NU = 1.0e3, 100.0, 0.499  # strength [Pa], mu/s_u [-], [-]
W = 1.0  # depth of the tip at the end, over B
COMPARED = 0.25  # depth at which the forces are compared, over B
FORMS = {
    "u_epsv_finite": "mixed $u$-$\\varepsilon_v$",
    "u_bbar_finite": "B-bar",
    "u_finite": "displacement only",
}


def cylinder(w: npt.ArrayLike) -> Array:
    """Force over s_u B of a smooth cylinder at a depth over B."""
    return np.asarray(5.3 * np.asarray(w) ** 0.25)


def footing(w: npt.ArrayLike) -> Array:
    """Force over s_u B of a footing as wide as the chord of the tip, at a depth over B."""
    w = np.minimum(w, 0.5)
    return np.asarray((2 + np.pi) * 2 * np.sqrt(w - w**2))


@dataclass(frozen=True)
class Run:
    """Penetration of a pile.

    Attributes:
        form: Weak form.
        n: Cells over B.
        depth: Depth of the tip at the end, over B.
        q: Force at the depth COMPARED, over s_u B.
        error: Its error against the cylinder [%].
        iterations, most: Newton iterations per step, mean and largest number.
        penetration: Deepest mean of a patch of the border in the pile at the end, over B.
        w, force: Depths over B and forces over s_u B, at the start and after each step.
        x, border, plastic: Particles and points of the border [m] and plastic strain at the end.
        stopped: Reason why the run ended early; empty if it did not.
    """

    form: str
    n: int
    depth: float
    q: float
    error: float
    iterations: float
    most: int
    penetration: float
    w: Array
    force: Array
    x: Array
    border: Array
    plastic: Array
    stopped: str


COLUMNS = ("form", "n", "depth", "q", "error", "iterations", "most", "penetration")


def solve(form: str, n: int = 4, w: float = W, step: float = 0.02) -> Run:
    """Press the pile into the ground.

    Args:
        form: Weak form of finite strain.
        n: Cells over B.
        w: Depth of the tip at the end, over B.
        step: Largest step of the depth, over B.
    """
    h, mu = B / n, RIGIDITY * S_U
    cells = (WIDTH * n, (DEPTH + ROOM) * n)
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0.0, -DEPTH), h=h, cells=cells)
    ground = tawami.box(grid, (0.0, -DEPTH), (WIDTH, 0.0), per_axis=3)
    elastic = tawami.linear_elastic(E=2 * mu * (1 + NU), nu=NU)
    clay = tawami.von_mises(elastic, yield_stress=np.sqrt(3) * S_U)
    scene = tawami.Scene(grid, ground, clay, form=form, tolerance=1e-5)
    for edge, component in (("left", "x"), ("right", "x"), ("bottom", "x"), ("bottom", "y")):
        scene.fix(edge, component)
    radius = B / 2 - CORE
    corners = [(-CORE, radius), (CORE, radius), (CORE, 2 * B), (-CORE, 2 * B)]
    tip = tawami.rigid_polygon(corners, radius=radius)
    pile = scene.obstacle(tip, where=lambda x, y: y == 0, displacement=(0.0, -w * B))
    start = pile.x[1]
    rows, iterations, inside = [(0.0, 0.0)], [0], [0.0]

    def each(solution: tawami.Solution) -> None:
        contact = solution.contact(pile)
        rows.append(((start - pile.x[1]) / B, 2 * contact.force[1] / (S_U * B)))
        iterations.append(solution.iterations)
        inside.append(contact.penetration / B)

    stopped = ""
    try:
        tawami.ramp(scene, step / w, each=each, stop="raise")
    except tawami.ConvergenceError as error:
        stopped = str(error)
    depth, force = np.transpose(rows)
    q = float(np.interp(COMPARED, depth, force, right=np.nan))
    return Run(
        form, n, float(depth[-1]), q, 100 * (q / float(cylinder(COMPARED)) - 1),
        float(np.mean(iterations[1:])), max(iterations), inside[-1], depth, force,
        np.array(scene.particles.x), np.array(scene.border.x),
        np.array(scene.particles.history("plastic_strain")), stopped,
    )  # fmt: skip


def draw(runs: Sequence[Run], path: Path) -> None:
    """Draw the forces over the depth, and the ground of the first run at the end."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4.6), layout="constrained")
    w = np.linspace(0, max(run.depth for run in runs), 200)
    left.plot(cylinder(w), w, "k", label="smooth cylinder")
    left.plot(footing(w), w, "k--", linewidth=0.8, label="footing as wide as the chord")
    for run in runs:
        label = f"{FORMS[run.form]}, B/h = {run.n}"
        left.plot(run.force, run.w, ".-", color=COLOURS[run.form], label=label)
    left.invert_yaxis()
    left.set_xlabel("force $Q / (s_u B)$ [-]")
    left.set_ylabel("depth of the tip $w / B$ [-]")
    left.grid()
    left.legend()
    run = runs[0]
    shown = right.scatter(
        *run.x.T, c=run.plastic, s=90 / run.n, cmap=style.FROM_ZERO, vmin=0, vmax=1
    )
    top = run.border[:, 1] > -run.depth * B - 0.1
    right.plot(*run.border[top & (run.border[:, 0] > 0)].T, ".", color="k", markersize=3)
    turn = np.linspace(-np.pi / 2, 0, 100)
    tip = B / 2 - run.depth * B
    outline = np.column_stack([B / 2 * np.cos(turn), tip + B / 2 * np.sin(turn)])
    right.plot(*np.vstack([outline, [B / 2, 2 * B]]).T, "k", linewidth=0.8)
    right.set(xlim=(0, 2), ylim=(-1.5, 0.5), aspect="equal", xlabel="$x$ [m]", ylabel="$y$ [m]")
    figure.colorbar(shown, ax=right, label="plastic strain [-]")
    save(figure, path)


PROGRAM = Program("cases.verification.penetration", __doc__)
PROGRAM.option("--cells", type=int, default=4, help="cells over the width B of the pile")
PROGRAM.option("--depth", type=float, default=W, help="depth of the tip at the end, over B")


def main(arguments: Sequence[str] | None = None) -> None:
    """Press the pile with each form, print the table, draw the figure."""
    options = PROGRAM.start(arguments)
    runs = [solve(form, options.cells, options.depth) for form in FORMS]
    print(as_text(runs, COLUMNS))
    for run in runs:
        if run.stopped:
            print(f"{run.form} ended at w = {run.depth:.3g} B: {run.stopped}")
    PROGRAM.write("table.csv", as_csv(runs, COLUMNS))
    draw(runs, PROGRAM.folder / "penetration.png")
    PROGRAM.list_results()


if __name__ == "__main__":
    PROGRAM.run(main)
