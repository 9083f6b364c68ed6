"""Extremes of statics, the short forms of `cases.extremes`: what survives, what is rejected and how."""

from __future__ import annotations

import functools
import re

import numpy as np
import pytest
from mpi4py import MPI
from scenes import grid_of

import tawami
from cases.extremes import __main__ as extremes
from cases.extremes import inf_sup, stability_map
from cases.extremes.attempt import Attempt, attempted, untouched

SUBJECTS = (
    "poisson", "alpha", "inf_sup", "particles", "slivers", "contrast", "scales", "directions",
    "overload", "not_finite",
)  # fmt: skip


@functools.cache
def rows(subject: str) -> tuple[Attempt, ...]:
    return tuple(extremes.tried(subject, True))


def outcomes(subject: str, setting: str) -> dict[str, Attempt]:
    """Those whose setting matches a pattern."""
    found = {row.setting: row for row in rows(subject) if re.search(setting, row.setting)}
    assert found, setting
    return found


@pytest.mark.parametrize("subject", SUBJECTS)
def test_no_result_is_wrong(subject):
    assert subject in extremes.SUBJECTS
    assert len(rows(subject)) > 5
    assert not [(row.setting, row.error, row.bound, row.says) for row in rows(subject) if row.wrong]


@pytest.mark.parametrize(("subject", "setting"), [
    ("poisson", r"^u_bbar: 1 - 2 nu = 0.0001"),
    ("poisson", r"^u_epsv.*: 1 - 2 nu = 1e-(10|04)"),
    ("poisson", r"^u_p: "),
    ("alpha", r"laplacian: alpha = 0.0001"),
    ("alpha", r"residual_based: alpha = 0.0001"),
    ("inf_sup", r""),
    ("particles", r"^(25|64) in each cell: u.*, quadratic_spline"),
    ("slivers", r"^(u|u_bbar|u_epsv, ghost|u_epsv, projection|u_p), "),
    ("contrast", r": (10|10000|1e\+07)$"),
    ("scales", r""),
    ("directions", r"degrees|100 cells|1e\+08 cells"),
    ("overload", r"elastic|Hencky's bar, .* ramp to"),
    ("not_finite", r"mended"),
])  # fmt: skip
def test_extremes_that_survive(subject, setting):
    if (subject, setting) == ("poisson", r"^u_p: "):
        found = {s: row for s, row in outcomes(subject, setting).items() if "held" not in s}
    else:
        found = outcomes(subject, setting)
    assert {s: row.outcome for s, row in found.items() if row.outcome != "survived"} == {}


@pytest.mark.parametrize(("subject", "setting", "message"), [
    ("poisson", "^u: 1 - 2 nu = 1e-10", "K/mu is 1.0e.10: .* has no digits left.* use form 'u_epsv'"),
    ("poisson", "held all around", "the tangent is singular"),
    ("alpha", "residual_based: alpha = (1|1000)$", "expected at most 0.14.* use a smaller alpha"),
    ("alpha", "alpha = (nan|inf|-0.1)", "expected a finite number of at least 0"),
    ("particles", "^1 in each cell: u.*spline", "the tangent is singular.*with 1 particles"),
    ("contrast", "^series.*1e\\+13", "shear moduli differ by a factor of 1.0e.13"),
    ("directions", r"1e\+16 cells", "origin = .*expected at most 1e.09 cells"),
    ("overload", "plastic, (von|Dru|Mohr)", "cause is the load, .*exceeds the strength of the material"),
    ("overload", "plastic, Tresca", r"Nothing was changed.* The load may be too large .* ramp\(scene"),
    ("overload", "at once", "turns particle .* inside out"),
    ("not_finite", "nan in (x|material|number)$", "read-only"),
    ("not_finite", "nan in volume", "volume: 1 entries are not finite.* NaN at particle 3"),
    ("not_finite", "nan in stress", ": 4 entries are not finite.* NaN at particle 3"),
    ("not_finite", "nan as", "not finite|finite number|finite modulus"),
])  # fmt: skip
def test_extremes_that_are_rejected(subject, setting, message):
    for row in outcomes(subject, setting).values():
        assert row.outcome == "refused", row
        assert re.search(message, row.says), row


def test_extremes_with_a_warning():
    for row in outcomes("poisson", "^u: 1 - 2 nu = 0.0001").values():
        assert row.outcome == "warned"
        assert "K/mu = 1e+04 at particle 0: it locks" in row.says
    for row in outcomes("alpha", "^u_epsv, laplacian: alpha = 1000$").values():
        assert row.outcome == "warned"
        assert "alpha = 1000: expected at most 1" in row.says
    crowded = outcomes("particles", "within 1/10 of a corner: .*tension")
    assert {row.outcome for row in crowded.values()} == {"warned"}
    assert all("has its particles on one side" in row.says for row in crowded.values())


def test_an_attempt_beyond_its_bound_or_without_a_message_is_wrong():
    def fails():
        raise KeyError("x")

    def refuses():
        raise tawami.InputError("no")

    assert attempted("s", "t", 1.0, lambda: 0.5).outcome == "survived"
    assert attempted("s", "t", 1.0, lambda: (2.0, "far")).wrong
    assert attempted("s", "t", 1.0, lambda: float("nan")).wrong
    assert attempted("s", "t", None, lambda: 0.0).wrong
    assert attempted("s", "t", None, fails).says == "KeyError: 'x'"
    assert attempted("s", "t", None, refuses).outcome == "refused"
    assert not attempted("s", "t", 1.0, refuses).wrong


def test_a_rejection_that_changes_particles_is_found():
    grid = grid_of()
    body = tawami.box(grid, grid.origin, grid.upper, per_axis=2)
    law = tawami.linear_elastic(E=1.0, nu=0.3)
    scene = tawami.Scene(grid, body, law)

    def change_and_refuse():
        with untouched(scene):
            scene.particles.stress[2] = 1.0
            raise tawami.InputError("no")

    with pytest.raises(RuntimeError, match="stress of the particles changed"):
        change_and_refuse()


def test_the_command_writes_a_table_and_fails_if_a_result_is_wrong(tmp_path, monkeypatch, capsys):
    class Broken:
        @staticmethod
        def attempts(short):
            yield attempted("broken", "first", 1.0, lambda: 0.5)
            raise ValueError("second")

    monkeypatch.setattr(extremes, "SUBJECTS", ("broken",))
    monkeypatch.setattr(extremes, "import_module", lambda name: Broken)
    with pytest.raises(SystemExit) as end:
        extremes.main(["--short", "--results", str(tmp_path), "--only", "broken"])
    assert end.value.code == 1
    printed = capsys.readouterr().out
    assert "the subject broke off: ValueError: second" in printed
    assert "broken: 2 tried; 1 survived, last: first; 1 WRONG, first: -" in printed
    assert len((tmp_path / "extremes.csv").read_text().splitlines()) == 3


@pytest.mark.slow
def test_the_map_of_stability(tmp_path):
    found = stability_map.points(short=True)
    refused = {(p.form, p.one_minus_2nu) for p in found if np.isnan(p.stress)}
    assert ("u_p", 0.0) not in refused
    assert ("u_epsv\nlaplacian", 0.0) in refused
    best = {p.form: p.stress for p in found if p.one_minus_2nu == 1e-4 and not p.alpha}
    assert best["u_p"] == pytest.approx(best["u_epsv\nprojection"], rel=1e-6)
    assert best["u_p"] < 0.01 < best["u"]
    stability_map.draw(found, tmp_path / "map.png")
    assert (tmp_path / "map.png").stat().st_size > 20000


def test_the_inf_sup_constant_agrees_with_one_assembled_by_hand():
    """The biquadratic pair: one-dimensional integrals by NumPy, A and B as Kronecker products."""
    n = 4
    points, weights = np.polynomial.legendre.leggauss(5)
    points, weights = (points + 1) / 2, weights / 2
    quadratic = [np.poly1d(c) for c in ([2, -3, 1], [-4, 4, 0], [2, -1, 0])]
    linear = [np.poly1d(c) for c in ([-1, 1], [1, 0])]

    def one_dimensional(left, right, a, b):
        """int of the a-th derivative of one basis times the b-th of the other, on n cells of 1/n."""
        sizes = [n * (len(f) - 1) + 1 for f in (left, right)]
        total = np.zeros(sizes)
        for c in range(n):
            for i, f in enumerate(left):
                for j, g in enumerate(right):
                    values = np.polyval(f.deriv(a), points) * np.polyval(g.deriv(b), points)
                    place = c * (len(left) - 1) + i, c * (len(right) - 1) + j
                    total[place] += n ** (a + b - 1) * weights @ values
        return total

    m, k, c = (one_dimensional(quadratic, quadratic, *d) for d in ((0, 0), (1, 1), (1, 0)))
    free = np.arange(1, 2 * n)
    m, k, c = (matrix[np.ix_(free, free)] for matrix in (m, k, c))
    # 2 dev eps : dev eps = grad u : grad w + (1 - 2/3) div u div w on functions that vanish all around
    xx, yy, xy = np.kron(m, k), np.kron(k, m), np.kron(c.T, c)  # x fastest
    third = 1 / 3
    a_matrix = np.block([[xx + yy + third * xx, third * xy], [third * xy.T, xx + yy + third * yy]])
    q0, q1 = (one_dimensional(linear, quadratic, 0, d)[:, free] for d in (0, 1))
    b_matrix = np.hstack([np.kron(q0, q1), np.kron(q1, q0)])
    one = one_dimensional(linear, linear, 0, 0)
    mass = np.kron(one, one)
    schur = b_matrix @ np.linalg.solve(a_matrix, b_matrix.T)
    values = np.sort(np.linalg.eigvals(np.linalg.solve(mass, schur)).real)
    beta = inf_sup.blocks("filled", n, "biquadratic", "laplacian").constant(0.0)
    assert abs(values[0]) < 1e-12  # the constant pressure
    assert beta == pytest.approx(np.sqrt(values[1]), rel=1e-8)


def test_a_box_off_the_lines_of_a_long_grid_keeps_its_area():
    """By 0.01 of a cell, 2000 cells away."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0.0, 0.0), h=1.0, cells=(2002, 1))
    body = tawami.box(grid, (2000.01, 0.0), (2002.0, 1.0), per_axis=2)
    assert body.volume.sum() == pytest.approx(1.99, abs=1e-12)


def test_points_of_a_tiny_body_are_distinguished():
    """Two points held 4e-9 m apart, on cells of 4e-9 m, each with its own reaction."""
    h = 4e-9
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0.0, 0.0), h=h, cells=(4, 4))
    body = tawami.box(grid, grid.origin, grid.upper, per_axis=2)
    law = tawami.linear_elastic(E=1e6, nu=0.3)
    scene = tawami.Scene(grid, body, law, form="u")
    left, right = (1.5 * h, 0.0), (2.5 * h, 0.0)
    scene.hold(left, "x")
    scene.hold(left, "y")
    scene.hold(right, "y")
    scene.traction(lambda x, y: (y == grid.upper[1]) & (x < 2 * h), (0.0, -3.0))
    scene.traction(lambda x, y: (y == grid.upper[1]) & (x > 2 * h), (0.0, -1.0))
    solution = scene.solve()
    forces = [solution.reaction(place)[1] for place in (left, right)]
    # 6 h at x = h and 2 h at x = 3 h, about the left point: (-6/2 + 2 3/2) h over a distance of h
    assert forces == pytest.approx([8 * h, 0.0], abs=1e-6 * h)


def test_a_soft_part_beside_a_stiff_one_is_no_rigid_motion():
    """Its forces are round-off of the stiff one: a contrast of 1e13 is rejected."""
    rows_of = outcomes("contrast", r"^series, u, bilinear: 1e\+13")
    assert {row.outcome for row in rows_of.values()} == {"refused"}
    grid = grid_of()
    body = tawami.box(grid, grid.origin, grid.upper, per_axis=2)
    law = tawami.linear_elastic(E=1e6, nu=0.3)
    scene = tawami.Scene(grid, body, law)
    scene.fix("left", "x", 0.3)  # rigidly: nothing to balance
    scene.fix("left", "y", 0.1)
    assert np.abs(scene.solve().displacement_of_particles - [0.3, 0.1]).max() < 1e-12


@pytest.mark.parametrize("size", [1e-15, 1e-12])
def test_a_tiny_prescribed_displacement_strains_the_body(size):
    """In proportion: no displacement is taken for round-off."""
    grid = grid_of()
    body = tawami.box(grid, grid.origin, grid.upper, per_axis=2)
    law = tawami.linear_elastic(E=1e6, nu=0.0)
    scene = tawami.Scene(grid, body, law, form="u")
    for edge, value in (("left", 0.0), ("right", size)):
        scene.fix(edge, "x", value)
    scene.fix("bottom", "y")
    scene.solve()
    assert scene.particles.stress[:, 0] == pytest.approx(1e6 * size / 2.0, rel=1e-6)
