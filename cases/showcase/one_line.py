"""One line of the weak form: a strip load on a nearly incompressible block, with and without it.

        p = 1 kPa
        |||||
     ___vvvvv_____________
    |                     |    2 m x 1 m, 32 x 16 cells, plane strain, E = 1 MPa, nu = 0.4999
    |_____________________|    smooth sides and floor, bilinear functions

The weak form is written as in a driver script. Its last term, alpha h^2 (K/mu) lap(eps_v), is the
stabilisation of the paper. Without it the mean stress oscillates from cell to cell.

python -m cases.showcase.one_line
"""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib.pyplot as plt
from mpi4py import MPI
from ufl import div, dot, grad

import tawami
from cases.common.figure import add_bar, draw_particles, save
from cases.common.program import Program
from cases.showcase.collapse.pile import roughness
from tawami.form import scalar, vector

PROGRAM = Program("cases.showcase.one_line", __doc__)
H, LOAD = 1 / 16, 1e3  # [m], [Pa]


def unstable(u, eps_v, w, q, sigma, K, sum_p):  # type: ignore[no-untyped-def]
    """The equations of the paper without stabilisation."""
    R_u = sum_p(sigma, grad(w))
    R_q = sum_p(K, q * (div(u) - eps_v))
    return R_u + R_q


def stable(u, eps_v, w, q, sigma, K, mu, h, sum_p):  # type: ignore[no-untyped-def]
    """The same equations with one more term."""
    R_u = sum_p(sigma, grad(w))
    R_q = sum_p(K, q * (div(u) - eps_v))
    R_q -= sum_p(K**2 / mu, 0.01 * h**2 * dot(grad(q), grad(eps_v)))
    return R_u + R_q


def solve(residual) -> tawami.Solution:  # type: ignore[no-untyped-def]
    """The block with a weak form."""
    fields = {"u": vector("w"), "eps_v": scalar("q", role="volumetric_strain")}
    form = tawami.Form(fields=fields, residual=residual)
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(-1, 0), h=H, cells=(32, 16))
    block = tawami.box(grid, (-1, 0), (1, 1), per_axis=3, gauss=True)
    rubber = tawami.linear_elastic(E=1e6, nu=0.4999)
    scene = tawami.Scene(grid, block, rubber, form=form, basis="bilinear")
    for edge in ("left", "right", "bottom"):
        scene.fix(edge, "x")
    scene.fix("bottom", "y")
    scene.traction(lambda x, y: (y == 1) & (abs(x) < 0.25), (0.0, -LOAD))
    return scene.solve()


def main(arguments: Sequence[str] | None = None) -> None:
    """Solve with both forms, print how rough their mean stress is, draw it."""
    PROGRAM.start(arguments)
    figure, axes = plt.subplots(1, 2, figsize=(9, 2.9), layout="constrained", sharey=True)
    for axis, residual in zip(axes, (unstable, stable), strict=True):
        solution = solve(residual)
        rough = roughness(solution.x, solution.mean_stress, H)
        title = "without the line" if residual is unstable else "with it"
        print(f"{title:16} roughness of the mean stress {rough:.4f}")
        stress, limits = solution.mean_stress, (-LOAD, 0.0)
        points = draw_particles(axis, solution.x, 0.4 * H, stress, "Pa", limits)
        axis.set(title=title, xlabel="$x$ [m]")
    axes[0].set_ylabel("$y$ [m]")
    add_bar(points, axes)
    save(figure, PROGRAM.folder / "mean_stress.png")
    PROGRAM.list_results()


if __name__ == "__main__":
    PROGRAM.run(main)
