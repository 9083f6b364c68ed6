"""Cook's membrane: the limit of finite elements, and the error of the MPM."""

from __future__ import annotations

import csv
from math import log2

import pytest
from programs import python

from cases.verification.cook import __main__ as study
from cases.verification.cook import fem, mpm
from cases.verification.cook.membrane import COLUMNS, REFERENCE, P

NU = 0.4999


@pytest.mark.parametrize("nu", REFERENCE)
def test_finite_elements_converge_to_the_reference(nu):
    coarse, fine = (fem.solve("fem_taylor_hood", nu, n) for n in (12, 24))
    assert coarse.deflection < fine.deflection < REFERENCE[nu]
    # the order of the singular corner
    assert log2(coarse.error_percent / fine.error_percent) == pytest.approx(1.13, abs=0.05)
    assert abs(fem.solve("fem_graded", nu, 48).error_percent) < 0.004


def test_displacement_only_elements_lock():
    row = fem.solve("fem_q2", NU, 12)
    # the code's own number: dolfinx's Q2 elements on 12 x 12 cells
    assert row.error_percent == pytest.approx(-2.46, abs=0.01)


def test_the_elements_import_nothing_of_tawami():
    code = "import sys, cases.verification.cook.fem; print(*sys.modules)"
    loaded = python("-c", code, check=True).stdout.split()
    assert "cases.verification.cook.fem" in loaded
    assert not [name for name in loaded if name.startswith("tawami")]


@pytest.mark.parametrize(
    ("method", "body", "error", "order"),
    [
        ("u_epsv_0.1", "even", 1.02, 1.62),
        ("u_epsv_0.1", "gauss", 0.68, 1.81),
        ("u_epsv_0.01", "even", 0.29, 1.51),
        ("u_epsv_0.01", "gauss", -0.08, 0.70),
        ("u_epsv_0.01", "lattice", 2.67, 1.03),
        ("u_epsv_projection", "gauss", -0.08, 0.73),
        ("u_bbar", "gauss", 2.85, 1.00),
        ("u", "gauss", -3.08, 1.25),
    ],
)
def test_error_at_h_2_and_order_towards_h_1(method, body, error, order):
    """[%]. Where all integrals are exact the order is that of finite elements; with alpha = 0.1 the
    error of the Laplacian, of second order, is larger. The numbers are results of the code; they are in
    the table of `python -m cases.verification.cook`, against the limit of finite elements.
    """
    coarse, fine = (mpm.solve(method, NU, h, body)[0].error_percent for h in (2.0, 1.0))
    assert coarse == pytest.approx(error, abs=0.01)
    assert log2(coarse / fine) == pytest.approx(order, abs=0.05)


def test_the_scaled_matrix_is_well_conditioned_with_cut_cells():
    for alpha in ("0.1", "0.01"):
        assert mpm.solve(f"u_epsv_{alpha}", NU, 1.0)[0].condition < 3e3


@pytest.mark.parametrize("h", [4.0, 1.0])
def test_the_clamp_carries_the_load(h):
    """Without `between` a traction would load the side of the cell below the loaded side too."""
    scene = mpm.build("u_epsv_0.1", NU, h)
    assert scene.solve().reaction("left") == pytest.approx([0.0, -P], abs=1e-6)


@pytest.mark.slow
def test_the_study_writes_table_and_figures(tmp_path):
    study.main(["--results", str(tmp_path), "--sizes", "4"])
    assert {path.name for path in tmp_path.iterdir()} == {
        "cook.csv", "deflection_error.png", "mean_stress.png",
    }  # fmt: skip
    with (tmp_path / "cook.csv").open(newline="") as file:
        header, *lines = csv.reader(file)
    assert tuple(header) == COLUMNS
    assert len(lines) == 2 * (len(fem.METHODS) + len(mpm.BODIES) * len(mpm.METHODS))


def test_sizes_that_miss_the_ends_of_the_load_are_rejected(capsys):
    with pytest.raises(SystemExit):
        study.main(["--sizes", "3"])
    assert (
        "argument --sizes: 3: expected divisors of 4 such as 4,2,1,0.5" in capsys.readouterr().err
    )
