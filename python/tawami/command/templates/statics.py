"""A beam of 2 m x 1 m, clamped on the left, 1 kN per metre depth down on the right.

Run it with `tawami run SCRIPT.py`, on four ranks with `tawami run SCRIPT.py --ranks 4`;
`tawami plot results/SCRIPT` draws the results. Metres, pascals, tension positive, plane strain.
"""

from pathlib import Path

from mpi4py import MPI

import tawami

RESULTS = Path("results") / Path(__file__).stem
CELLS_OVER_THE_HEIGHT = 16


def main() -> None:
    """Build the scene, solve it, print and write the results."""
    # the grid: squares of side h; the body has to lie within it
    n = CELLS_OVER_THE_HEIGHT
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, -0.5), h=1 / n, cells=(2 * n, n))

    # the body: 2 x 2 particles in each cell; tawami.polygon(...) for slanted sides
    beam = tawami.box(grid, (0, -0.5), (2, 0.5), per_axis=2)

    # its material: also von_mises, drucker_prager, mohr_coulomb, NumpyLaw
    rubber = tawami.linear_elastic(E=3e6, nu=0.4999)

    # the weak form: the mixed u-eps_v form does not lock; the path of your own file works too
    scene = tawami.Scene(grid, beam, rubber, form="u_epsv")

    # supports and loads, on edges of the grid: numbers, or functions of (x, y)
    scene.fix("left", "x")
    scene.fix("left", "y")
    scene.traction("right", (0.0, -1e3))

    print(scene.header())

    # the results, for ParaView and for pictures; an earlier run in the folder is replaced
    results = tawami.Results(
        RESULTS,
        tawami.ParticleOutput(),
        tawami.GridOutput(),
        tawami.TableOutput("displacement (2, 0)", "reaction left"),
        existing="replace",
    )

    def report(solution: tawami.Solution) -> None:
        print("tip deflection [m]:", -solution.displacement((2, 0))[1])
        print("Newton iterations:", solution.iterations)
        print("reaction of the clamp [N/m]:", solution.reaction("left"))

    # the load in one step; scene.solve() does the same without results
    tawami.ramp(scene, 1.0, each=report, results=results, stop="raise")
    print("written to", RESULTS)


if __name__ == "__main__":
    tawami.run(main, Path(__file__).stem)
