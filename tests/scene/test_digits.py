"""Steps whose stresses are round-off are rejected."""

import numpy as np
import pytest
from mpi4py import MPI

import tawami

ELASTIC = tawami.linear_elastic(E=1e3, nu=0.3)


def sheared(shear):
    """A von Mises block in simple shear by prescribed displacements."""
    grid = tawami.Grid(MPI.COMM_SELF, origin=(0, 0), h=1.0, cells=(1, 1))
    law = tawami.von_mises(ELASTIC, yield_stress=1.0)
    body = tawami.box(grid, grid.origin, grid.upper, per_axis=3, gauss=True)
    scene = tawami.Scene(grid, body, law, form="u_epsv", basis="bilinear")
    for edge in ("left", "right", "bottom", "top"):
        scene.fix(edge, "x", lambda x, y: shear * y)
        scene.fix(edge, "y")
    return scene


@pytest.mark.filterwarnings("ignore::tawami.SmallStrainWarning")
def test_a_shear_of_a_million_yields():
    solution = sheared(1e6).solve()
    assert np.allclose(solution.stress[:, 3], 1 / np.sqrt(3), rtol=1e-6)


@pytest.mark.filterwarnings("ignore::tawami.SmallStrainWarning")
def test_a_shear_beyond_the_digits_of_the_stress_is_rejected():
    scene = sheared(1e13)
    with pytest.raises(
        tawami.ConvergenceError, match="so large that round-off is .* of the stresses"
    ):
        scene.solve()
    assert not scene.particles.stress.any()
