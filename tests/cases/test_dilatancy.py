"""Dilatant plasticity: the block arrives, and the rate problem of a patch has exactly one solution."""

from __future__ import annotations

import numpy as np
import pytest

from cases.verification.dilatancy import block, enumeration


@pytest.mark.parametrize("nu", block.NU)
@pytest.mark.parametrize("psi", block.PSI)
def test_a_pressed_block_arrives_in_few_iterations(psi, nu):
    run = block.solve(psi, nu, steps=5)
    assert run.arrived == 1.0
    assert run.iterations <= 6
    # the limit load hardly depends on dilation and compressibility: no locking
    assert run.reaction == pytest.approx(2.885, rel=0.01)
    # LDL^T serves where the flow is associated
    assert run.symmetric == (psi == block.PHI)


@pytest.mark.parametrize("nu", [0.3, 0.4999])
def test_the_tangent_of_associated_flow_is_symmetric(nu):
    """Away from the apex, where the deviator is zero but the plastic volume depends on the strain."""
    K = 2 * block.MU * (1 + nu) / (3 * (1 - 2 * nu))
    asymmetry = []
    for psi in (10.0, block.PHI):
        scene = block.build(psi, nu)
        c = 0.01 * np.random.default_rng(0).standard_normal(scene.num_coefficients)
        vertices = (scene.grid.cells[0] + 1) * (scene.grid.cells[1] + 1)
        c[-vertices:] *= block.MU / K  # the mean stress stays below the apex, 2.7 c
        tangent = np.asarray(scene.tangent(c).todense())
        used = tangent.diagonal() != 0
        scale = np.where(used, 1 / np.sqrt(np.where(used, abs(tangent.diagonal()), 1)), 0)
        scaled = scale[:, None] * tangent * scale
        asymmetry.append(abs(scaled - scaled.T).max() / abs(scaled).max())
    assert asymmetry[0] > 1e-3
    assert asymmetry[1] < 1e-12


@pytest.mark.parametrize("nu", enumeration.NU)
def test_the_elastic_field_has_one_consistent_set_in_every_state(nu):
    counts = enumeration.count("elastic", nu, states=5)
    assert counts.one == counts.states
    assert counts.negative == 0.0


def test_the_matrix_of_the_elastic_field_is_symmetric_and_positive():
    patch = enumeration.Patch(0.4999)
    n, load, _ = enumeration.state(0, patch)
    M, _ = patch.complementarity("elastic", n, load)
    assert abs(M - M.T).max() < 1e-12
    assert np.linalg.eigvalsh(M)[0] > 0


def test_the_total_field_has_states_with_no_solution_and_with_several():
    counts = enumeration.count("total", 0.49, states=10)
    assert counts.none > 0
    assert counts.more > 0
    assert 0 < counts.negative < 1
