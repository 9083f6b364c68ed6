"""Biaxial compression of a dilatant block at finite strain: the volume against its closed form."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from mpi4py import MPI

import tawami

PHI, C, MU = 20.0, 1.0, 100.0
# with 20 steps Newton fails in the step that reaches the limit, for psi = 20 and nu >= 0.49
STEPS = 80
TOTAL = -np.log(0.8)  # logarithmic axial strain at 20 %
LIMIT = 0.05


@dataclass
class State:
    """The uniform block after a step: axial strain, logarithm of the volume, dilatancy, Kirchhoff
    stress [Pa] and history `plastic_strain`.
    """

    axial: float
    volume: float
    dilatancy: float
    stress: np.ndarray
    plastic: float


def compressed(law, psi, nu, limit):
    """States of a block with smooth sides that is free on the right, up to 20 %; and its law.

    The deformation is uniform, so that the particles can stay where they are: the increment of a step
    is the same everywhere on the grid.
    """
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0.0, 0.0), h=1.0, cells=(1, 1))
    body = tawami.box(grid, (0.0, 0.0), (1.0, 1.0), per_axis=3, gauss=True)
    elastic = tawami.linear_elastic(E=2 * MU * (1 + nu), nu=nu)
    soil = law(elastic, phi=PHI, c=C, psi=psi, eps_v_max=limit)
    scene = tawami.Scene(grid, body, soil, form="u_epsv_finite", tolerance=1e-10)
    scene.fix("left", "x")
    scene.fix("bottom", "y")
    scene.fix("top", "y", np.expm1(-TOTAL / STEPS))
    domain, particles, states = scene.configuration.domain, scene.particles, []
    for k in range(1, STEPS + 1):
        step = domain.newton.solve(scene.reduction(), scene.configuration.external())
        domain.stage.commit(*scene.split(step.coefficients))
        columns = [
            particles.eps_v,
            particles.history("dilatancy"),
            particles.history("plastic_strain"),
        ]
        for column in columns:
            assert np.ptp(column) < 1e-6
        volume, dilatancy, plastic = (float(column[0]) for column in columns)
        states.append(
            State(k * TOTAL / STEPS, volume, dilatancy, particles.stress[0].copy(), plastic)
        )
    return states, soil


@pytest.mark.parametrize("nu", [0.3, 0.49, 0.4999])
@pytest.mark.parametrize("psi", [5.0, 20.0])
def test_the_volume_of_mohr_coulomb_follows_its_closed_form(psi, nu):
    """The stress is constant from yield on. eps_p = 2 sin psi/(1 - sin psi) times the axial strain."""
    states, soil = compressed(tawami.mohr_coulomb, psi, nu, LIMIT)
    sin_phi, sin_psi = np.sin(np.radians([PHI, psi]))
    limit_stress = -2 * C * np.cos(np.radians(PHI)) / (1 - sin_phi)
    at_yield = -limit_stress * (1 - nu**2) / (2 * MU * (1 + nu))
    for state in states:
        flow = max(state.axial - at_yield, 0.0)
        expected = min(2 * sin_psi / (1 - sin_psi) * flow, LIMIT)
        assert state.dilatancy == pytest.approx(expected, abs=1e-8)
        if flow > 0:
            assert state.stress[:2] == pytest.approx([0.0, limit_stress], abs=1e-6)
        elastic = state.stress[:3].mean() / soil.bulk_modulus
        # the particles store the total, elastic and plastic
        assert state.volume == pytest.approx(elastic + expected, abs=1e-8)
    assert states[-1].dilatancy == pytest.approx(
        min(LIMIT, 2 * sin_psi / (1 - sin_psi) * (TOTAL - at_yield)), abs=1e-8
    )


@pytest.mark.parametrize("nu", [0.3, 0.49, 0.4999])
@pytest.mark.parametrize("psi", [5.0, 20.0])
def test_the_volume_of_drucker_prager_follows_its_closed_form(psi, nu):
    """eps_p is Ab times the multiplier; the stress tends to that of Mohr-Coulomb in plane strain."""
    states, soil = compressed(tawami.drucker_prager, psi, nu, LIMIT)
    tan_psi, sin_psi = np.tan(np.radians(psi)), np.sin(np.radians(psi))
    flow = 3 * tan_psi / np.sqrt(9 + 12 * tan_psi**2)
    for state in states:
        assert state.dilatancy == pytest.approx(min(flow * state.plastic, LIMIT), abs=1e-9)
        elastic = state.stress[:3].mean() / soil.bulk_modulus
        assert state.volume == pytest.approx(elastic + state.dilatancy, abs=1e-8)
        assert abs(state.stress[0]) < 1e-6
    free = [s for s in states if s.dilatancy < LIMIT - 1e-12]
    slope = (free[-1].dilatancy - free[-2].dilatancy) / (TOTAL / STEPS)
    assert slope == pytest.approx(2 * sin_psi / (1 - sin_psi), rel=0.05)


def test_a_tangent_without_a_mean_part_is_rejected():
    """A law whose mean stress is constant, in a form with a field for it."""

    def respond(strain, stress):
        new = stress.copy()
        new[:, 3] += strain[:, 3]
        return new, np.broadcast_to(np.diag([0.0, 0.0, 0.0, 1.0]), (len(strain), 4, 4))

    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0.0, 0.0), h=0.5, cells=(2, 2))
    body = tawami.box(grid, (0.0, 0.0), (1.0, 1.0), per_axis=3)
    scene = tawami.Scene(grid, body, tawami.NumpyLaw(respond, K=2.0, mu=1.0), form="u_epsv")
    scene.fix("left", "x")
    scene.fix("bottom", "y")
    scene.fix("right", "x", 0.01)
    with pytest.raises(tawami.InputError, match="without a mean part"):
        scene.solve()
