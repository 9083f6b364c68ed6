"""The beam by finite elements alone: values, orders, and that it imports nothing of tawami."""

from __future__ import annotations

import pytest
from programs import python

from cases.verification.cantilever import fem


@pytest.mark.parametrize(
    ("support", "n", "error", "tolerance"),
    [
        ("exact", 8, -0.0015, 0.0002),
        ("paper", 8, 9.55, 0.01),
        ("clamped", 8, -5.857, 0.002),
        ("clamped", 16, -5.674, 0.002),
        ("clamped", 32, -5.593, 0.002),
    ],
)
def test_the_error_of_taylor_hood_elements(support, n, error, tolerance):
    """[%] against the closed form. The numbers are the code's own, of dolfinx's elements: exact is
    small, paper grows with n, and clamped tends to the limit of `beam.V_CLAMPED`, -5.53 %.
    """
    assert fem.solve("fem_taylor_hood", support, n).error_percent == pytest.approx(
        error, abs=tolerance
    )


@pytest.mark.parametrize("method", fem.METHODS)
def test_the_orders_on_the_smooth_beam(method):
    coarse, fine = (fem.solve(method, "exact", n) for n in (4, 8))
    order = {"fem_q2": 3.5, "fem_taylor_hood": 2.5, "fem_q1_bbar": 1.9}[method]
    assert abs(coarse.error_percent / fine.error_percent) > 2**order
    assert coarse.mean_stress_l2 / fine.mean_stress_l2 > 2**1.9


def test_the_elements_import_nothing_of_tawami():
    code = "import sys, cases.verification.cantilever.fem; print(*sys.modules)"
    loaded = python("-c", code, check=True).stdout.split()
    assert "cases.verification.cantilever.fem" in loaded
    assert not [name for name in loaded if name.startswith("tawami")]
