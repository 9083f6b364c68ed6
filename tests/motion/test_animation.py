"""Animations of a motion: frames at multiples of a time, and the same motion as without them."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from mpi4py import MPI
from PIL import Image

import tawami


def flying(**options):
    """A block that flies to the right."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0.0, 0.0), h=0.5, cells=(6, 3))
    body = tawami.box(grid, (0.5, 0.5), (1.5, 1.0), per_axis=2)
    jelly = tawami.linear_elastic(E=1e4, nu=0.3)
    scene = tawami.Scene(grid, body, jelly, form="u_finite", density=1.0)
    return tawami.Dynamics(scene, velocity=(1.0, 0.0), **options)


def frames_of(animation):
    return animation._func.__self__.frames


def test_a_motion_is_run_and_animated(tmp_path):
    motion, other, times = flying(), flying(), []
    animation = motion.animate(
        1.0, 0.125, "velocity x", every=0.25, each=lambda s: times.append(s.scene.time)
    )
    other.run(1.0, 0.125)
    assert (motion.time, motion.steps) == (1.0, 8)
    assert np.array_equal(motion.scene.particles.x, other.scene.particles.x)
    assert times == list(np.arange(1, 9) / 8)
    frames = frames_of(animation)
    assert [frame.title for frame in frames] == [f"$t$ = {t:g} s" for t in (0, 0.25, 0.5, 0.75, 1)]
    np.testing.assert_allclose(frames[2].x - frames[0].x, [[0.5, 0.0]] * 8, atol=1e-9)
    np.testing.assert_allclose(frames[-1].values, 1.0)
    animation.save(tmp_path / "block.gif")
    with Image.open(tmp_path / "block.gif") as image:
        assert image.n_frames == 5
    page = animation._repr_html_()
    assert page.count("data:image/png;base64") == 5
    assert "<script" in page
    assert "http" not in page.replace("http://www.w3.org", "")
    assert "fa-" not in page


def test_the_last_state_is_a_frame_and_there_are_about_48_by_default():
    motion = flying()
    assert len(frames_of(motion.animate(0.1, 0.05, every=1.0))) == 2
    assert 40 <= len(frames_of(motion.animate(0.6, 0.005))) <= 50


def test_an_animation_and_the_results_of_a_run_go_together(tmp_path):
    results = tawami.Results(tmp_path, tawami.ParticleOutput("velocity"))
    shear = tawami.Quantity("stress [Pa]", lambda p: p.stress[:, 3])
    animation = flying().animate(0.2, 0.1, shear, limits=(-1, 1), deformed=2.0, results=results)
    assert len(frames_of(animation)) == 3
    assert (tmp_path / "motion" / "particles.pvd").exists()


@pytest.mark.parametrize(
    ("arguments", "options", "message"),
    [
        (("strss",), {}, "quantity: 'strss' is unknown"),
        (("velocity",), {"every": 0.0}, "every = 0"),
        (("velocity",), {"limits": 3.0}, "limits = 3.0: expected two numbers"),
        (("velocity",), {"each": 3.0}, "each = 3.0: expected a function of a solution"),
    ],
)
def test_wrong_arguments_are_rejected_before_the_first_step(arguments, options, message):
    motion = flying()
    with pytest.raises(tawami.InputError, match=message):
        motion.animate(1.0, 0.1, *arguments, **options)
    assert motion.steps == 0


def test_a_missing_package_is_named_before_the_first_step(monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    motion = flying()
    with pytest.raises(
        tawami.MissingDependencyError, match="pictures need matplotlib: pip install"
    ):
        motion.animate(1.0, 0.1)
    assert motion.steps == 0
