"""Consolidation: Terzaghi's column and Mandel's slab against their series."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI
from ufl import dot, inner

import tawami
from cases.verification import consolidation as case
from tawami.form import scalar, vector


def test_the_series_agree_with_known_numbers():
    """U = 0.5 at T_v = 0.197 and 0.9 at 0.848; Mandel's slab starts at half the load."""
    assert case.degree(0.197) == pytest.approx(0.5, abs=5e-4)
    assert case.degree(0.848) == pytest.approx(0.9, abs=5e-4)
    assert case.mandel_pressure(1e-6, 0.0)[0] == pytest.approx(0.5, abs=1e-3)


def test_terzaghi_early():
    run = case.terzaghi(n=8, first=1e-3, last=0.1, growth=0.1)
    assert abs(run.error(0.1)) < 0.5
    assert run.rms[0.1] < 0.0055


@pytest.mark.slow
def test_terzaghi():
    run = case.terzaghi()
    for T in case.SHOWN:
        assert abs(run.error(T)) < 0.5
        assert run.rms[T] < 0.005


def test_the_pressure_of_mandel_rises_before_it_falls():
    run = case.mandel(n=8, first=5e-3, last=0.3, growth=0.25, most=0.04)
    assert max(run.value) > run.value[0] + 0.03
    np.testing.assert_allclose(run.value, run.exact, atol=0.01)
    assert run.force == pytest.approx(np.ones(len(run.force)), abs=0.02)


def test_alpha_w_removes_the_overshoot_of_a_small_step():
    """The bound of Vermeer and Verruijt, c_v dt = h^2/6, is 1/384 for 8 cells."""
    peaks = {a: case.terzaghi(8, 1e-5, 1e-5, alpha_w=a).peak for a in (0.0, 1 / 6)}
    assert peaks[0.0] > 1.15
    assert peaks[1 / 6] < 1.005


def test_water_enters_as_the_flux_says():
    """A tight column swells by the water that enters: flux [m/s] times time."""
    scene = case.column(4)
    scene.release("top", "p_w")
    scene.flux("top", "p_w", 2e-6)
    solution = scene.solve(until=3.0)
    assert case.H * solution.strain[:, 1].mean() == pytest.approx(6e-6, rel=1e-6)


def test_water_enters_the_form_of_the_tutorial_as_the_flux_says():
    """Of python/docs/edit_a_form.md: the sign and the factor of the equation of p_w."""
    page = Path(tawami.__file__).parents[1] / "docs/edit_a_form.md"
    cells = re.findall(r"```\{code-cell\}\n(.*?)```", page.read_text(), re.DOTALL)
    (cell,) = [cell for cell in cells if "biot = tawami.Form" in cell]
    names = {"inner": inner, "dot": dot, "tawami": tawami, "scalar": scalar, "vector": vector}
    exec(cell, names)  # a page of the documentation
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=0.25, cells=(2, 4))
    law = tawami.linear_elastic(E=1e6, nu=0.3)
    body = tawami.box(grid, (0, 0), (0.5, 1), gauss=True)
    scene = tawami.Scene(grid, body, law, form=names["biot"])
    scene.data("kappa", 1e-12)
    for edge, component in (("left", "x"), ("right", "x"), ("bottom", "y")):
        scene.fix(edge, component)
    scene.flux("top", "p_w", 2e-9)
    solution = scene.solve(until=3e3)
    assert solution.strain[:, 1].mean() == pytest.approx(6e-6, rel=1e-6)


@pytest.mark.parametrize("biot", [1.0, 0.7])
def test_undrained_pressure_of_a_compressible_fluid(biot):
    """biot e = S p and M e + biot p = q under the load q: p = biot q/(biot^2 + S M)."""
    storage, M = 2e-7, case.lame(case.NU_COLUMN)[1]
    scene = case.column(4, storage=storage, biot=biot)
    scene.release("top", "p_w")
    for until in (1.0, 5.0):
        solution = scene.solve(until=until)
    expected = biot * case.LOAD / (biot**2 + storage * M)
    np.testing.assert_allclose(solution.field("p_w"), expected, rtol=1e-8)


def test_water_at_rest_is_hydrostatic():
    """After a long time p_w = rho_w g (H - z), and the effective stress carries load and weight."""
    scene = case.column(4, density=2000.0)
    scene.gravity((0.0, -10.0))
    for until in (1e9, 2e9):
        solution = scene.solve(until=until)
    depth = case.H - scene.particles.x[:, 1]
    np.testing.assert_allclose(solution.field("p_w"), 1e4 * depth, rtol=1e-6)
    mean = -(case.LOAD + 1e4 * case.H / 2)
    weight = scene.configuration.domain.volume  # those of the integrals, with which forces balance
    vertical = weight @ solution.stress[:, 1] / weight.sum()
    assert vertical == pytest.approx(mean, rel=1e-6)
