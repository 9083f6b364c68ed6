"""Bodies of several parts: `one + other`."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from moments import of_particles
from mpi4py import MPI

import tawami

SOFT, STIFF = (tawami.linear_elastic(E=E, nu=0.3) for E in (1e3, 4e3))


def grid_of_two(n=8, origin=(0.0, 0.0)):
    return tawami.Grid(MPI.COMM_WORLD, origin=origin, h=2 / n, cells=(n, n))


def halves(grid):
    """The square of 2 m divided along a line that cuts cells."""
    lower = tawami.polygon(grid, [(0, 0), (2, 0), (2, 1.37), (0, 0.61)])
    return lower, tawami.polygon(grid, [(0, 0.61), (2, 1.37), (2, 2), (0, 2)])


def test_a_sum_has_the_moments_and_the_groups_of_its_parts():
    grid = grid_of_two()
    lower, upper = (
        part.named(name) for part, name in zip(halves(grid), ("clay", "sand"), strict=True)
    )
    body = lower + upper
    both = of_particles(lower) + of_particles(upper)
    np.testing.assert_allclose(of_particles(body), both, rtol=1e-14)
    assert body.volume.sum() == pytest.approx(4.0, rel=1e-12)
    assert body.names == ("clay", "sand")
    assert body.material_of.tolist() == [0] * len(lower.x) + [1] * len(upper.x)
    scene = tawami.Scene(
        grid, body, {"sand": STIFF, "clay": SOFT}, density={"clay": 1.0, "sand": 3.0}
    )
    assert scene.mass.sum() == pytest.approx(lower.volume.sum() + 3 * upper.volume.sum())
    assert pickle.loads(pickle.dumps(body)).volume.sum() == body.volume.sum()  # to bcast it


def test_groups_of_the_same_name_become_one():
    grid = grid_of_two()
    boxes = [tawami.box(grid, (k / 2, 0), (k / 2 + 0.5, 1)) for k in range(4)]
    body = sum(box.named(name) for box, name in zip(boxes, "abca", strict=True))
    assert body.names == ("a", "b", "c")
    assert np.bincount(body.material_of).tolist() == [2 * len(boxes[0].x)] + 2 * [len(boxes[0].x)]
    again = body + tawami.box(grid, (0, 1), (2, 2)).named("b")
    assert again.names == ("a", "b", "c")
    alike = boxes[0].named("a") + boxes[1].named("a")
    assert alike.names == ("a",)
    assert alike.material_of is None


def test_parts_without_names_keep_the_numbers_of_their_materials():
    grid = grid_of_two()
    one, other = tawami.box(grid, (0, 0), (1, 1)), tawami.box(grid, (1, 0), (2, 1))
    assert (one + other).material_of is None
    numbered = tawami.Body(other.x, other.volume, np.full(len(other.x), 2, dtype=np.uint32))
    assert (one + numbered).material_of.tolist() == [0] * len(one.x) + [2] * len(one.x)
    assert sum([one]) is one


@pytest.mark.parametrize(
    "options", [{"form": "u"}, {"form": "u_epsv"}, {"form": "u_epsv", "ghost_penalty": "on"}]
)
def test_the_patch_test_holds_across_a_seam_that_cuts_cells(options):
    """Two layers pulled by their top beside a part of the grid without particles: uniform stress."""
    grid = grid_of_two(10)
    lower = tawami.polygon(grid, [(0, 0), (1.2, 0), (1.2, 0.87), (0, 0.61)], gauss=True)
    upper = tawami.polygon(grid, [(0, 0.61), (1.2, 0.87), (1.2, 2), (0, 2)], gauss=True)
    body = lower.named("lower") + upper.named("upper")
    scene = tawami.Scene(grid, body, [SOFT, SOFT], tolerance=1e-12, **options)
    scene.fix("left", "x")
    scene.fix("bottom", "y")
    scene.traction("top", (0.0, 2.0))
    stress = scene.solve().stress
    np.testing.assert_allclose(stress, [[0.0, 2.0, 0.6, 0.0]] * len(stress), rtol=0, atol=1e-8)


def test_bodies_that_overlap_or_do_not_fit_are_rejected():
    grid = grid_of_two()
    lower, upper = halves(grid)
    box = tawami.box(grid, (0, 0), (1, 1))
    for one, other, words in (
        (box, box, r"overlap by at least 1 m2, most in the cell at \(0.125, 0.125\) m"),
        (lower, tawami.disc(grid, (1, 1), 0.5), r"overlap by at least 0\.\d+ m2"),
        (box, tawami.box(grid_of_two(4), (1, 1), (2, 2)), "made for different grids"),
        (
            box.named("clay"),
            tawami.box(grid, (1, 1), (2, 2)),
            "one has the groups 'clay' and the oth",
        ),
        (box, tawami.Body(np.ones((2, 3)), np.ones(2)), r"x of shape \(2, 3\) with 2 volumes"),
    ):
        with pytest.raises(tawami.InputError, match=words):
            one + other
    assert len((lower + upper).x) == len(lower.x) + len(upper.x)  # they touch in cut cells
    with pytest.raises(TypeError, match="unsupported operand"):
        box + 1
    for name in ("", 3):
        with pytest.raises(tawami.InputError, match="expected a name, as 'clay'"):
            box.named(name)
    both = box.named("clay") + tawami.box(grid, (1, 1), (2, 2)).named("sand")
    with pytest.raises(tawami.InputError, match="the body has the groups 'clay', 'sand'"):
        both.named("soil")
