"""A block of soil slumps under its weight on a rough floor.

Run it with `tawami run SCRIPT.py`, on four ranks with `tawami run SCRIPT.py --ranks 4`. An interrupted
run is resumed with `tawami resume results/SCRIPT`; `tawami plot results/SCRIPT` draws the results.
Metres, seconds, pascals, tension positive, plane strain.
"""

from pathlib import Path

from mpi4py import MPI

import tawami

RESULTS = Path("results") / Path(__file__).stem
END = 0.3  # s
STEP = 2e-3  # s


def main() -> None:
    """Build the scene, find its equilibrium under the weight, release it, run the motion."""
    # the grid: squares of side h, wide enough for the motion; it is reset after each step
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=0.05, cells=(16, 6))

    # the body: 2 x 2 particles in each cell
    block = tawami.box(grid, (0, 0), (0.4, 0.2), per_axis=2)

    # its material: elastic up to the yield surface; angles in degrees
    elastic = tawami.linear_elastic(E=1e6, nu=0.3)
    soil = tawami.drucker_prager(elastic, phi=20.0, c=10.0)

    # the weak form: finite strain, particles that move; inertia and weight need a density [kg/m3]
    scene = tawami.Scene(grid, block, soil, form="u_epsv_finite", density=2000.0)

    # supports: symmetry on the left, a floor with friction at the bottom; and the weight
    scene.fix("left", "x")
    scene.wall("bottom", friction=0.5)
    scene.gravity((0.0, -9.81))

    # the results: particles for ParaView, a table, checkpoints from which the run can be resumed;
    # `every` is a share of the load in the ramp below, and a time [s] in the motion
    results = tawami.Results(
        RESULTS,
        tawami.ParticleOutput(every=0.02),
        tawami.TableOutput(),
        checkpoint_steps=50,
    )

    # a gate holds the right side while the weight is applied without inertia; then it is removed
    gate = [(0.4, 0.025 * k) for k in range(9)]
    for point in gate:
        scene.hold(point, "x")
    tawami.ramp(scene, 0.1, results=results, stop="raise")
    for point in gate:
        scene.release(point)

    motion = tawami.Dynamics(scene)
    print(motion.header())
    motion.run(end=END, dt=STEP, results=results)

    # scene.particles are those of one rank
    run_out = grid.comm.allreduce(scene.particles.x[:, 0].max(initial=0.0), op=MPI.MAX)
    print("run-out [m]:", run_out)
    print("energies [J/m]:", motion.energies)


if __name__ == "__main__":
    tawami.run(main, Path(__file__).stem)
