"""Estimated errors compared with closed forms and finite elements."""

from __future__ import annotations

import pytest

from cases.verification import effectivity


@pytest.mark.parametrize("form", ["u_epsv", "u_p", "u_bbar"])
def test_the_tip_of_the_cantilever(form):
    row, _ = effectivity.on_cantilever(form, 4)
    assert row.effectivity == pytest.approx(1, abs=0.03)
    # evenly spaced particles cause most of the error
    assert row.particles > 0.7 * row.true
    assert row.stabilisation == 0 or form != "u_bbar"


def test_particles_at_gauss_points_integrate_exactly():
    row, _ = effectivity.on_cantilever("u_epsv", 4, per_axis=3, gauss=True)
    assert row.effectivity == pytest.approx(1, abs=0.05)
    assert abs(row.particles) < 1e-9 * row.true


def test_the_support_of_the_paper_has_no_limit():
    row, _ = effectivity.on_cantilever("u_epsv", 8, "paper")
    assert row.order < 0.2


def test_cook_in_cut_cells():
    row, found = effectivity.on_cook(1.0)
    assert 0.7 < row.effectivity < 1.4
    assert row.order == pytest.approx(1.1, abs=0.3)  # of the singular corner, by finite elements
    nx, ny = 48, 60
    assert all(cells.shape == (ny, nx) for cells in found.cells.values())


def test_arcs_keep_their_area_in_each_cell():
    """The error of the ring is 2e-5, that of chords of the same length with their ends on the arcs."""
    row, _ = effectivity.on_shifted_ring(8, 0.37)
    assert row.effectivity == pytest.approx(1, abs=0.1)


@pytest.mark.slow
@pytest.mark.parametrize("quantity", ["u", "mean stress"])
def test_the_ring(quantity):
    row, _ = effectivity.on_ring(4, quantity)
    assert 0.7 < row.effectivity < 1.4
