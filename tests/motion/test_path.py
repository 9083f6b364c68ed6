"""Paths of equilibria beyond limit points: a column that softens."""

from __future__ import annotations

import re
import warnings

import numpy as np
import pytest
from mpi4py import MPI
from scenes import grid_of

import tawami

pytestmark = pytest.mark.filterwarnings("ignore:the material softens:UserWarning")
MU, TAU = 100.0, 1.0  # [Pa]
LAYERS = 4  # of 1 m


def column(softening: float) -> tawami.Scene:
    """A column of 1 m x 4 m in simple shear by a traction on its top, twice the strength of the layer
    at its bottom, whose strength falls by `softening` times the plastic shear strain.

    `zz` carries the plastic shear strain times mu: it enters no equation of plane strain.
    """
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=1.0, cells=(1, LAYERS))
    body = tawami.box(grid, (0, 0), (1, LAYERS), per_axis=2)
    weak = body.x[:, 1] < 1.0

    def respond(strain, stress):
        new, tangent = stress.copy(), np.zeros((len(strain), 4, 4))
        new[:, :2] += 2 * MU * strain[:, :2]
        trial = stress[:, 3] + MU * strain[:, 3]
        plastic = stress[:, 2] / MU
        strength = np.where(weak, np.maximum(TAU - softening * plastic, 0.0), np.inf)
        excess = np.abs(trial) - strength
        slip = np.where(excess > 0, excess / (MU - softening), 0.0)
        new[:, 3] = trial - MU * slip * np.sign(trial)
        new[:, 2] = MU * (plastic + slip)
        tangent[:, [0, 1, 2], [0, 1, 2]] = 2 * MU
        tangent[:, 3, 3] = np.where(excess > 0, -MU * softening / (MU - softening), MU)
        return new, tangent

    law = tawami.NumpyLaw(respond, K=MU, mu=MU)
    scene = tawami.Scene(grid, body, law, form="u", basis="bilinear")
    for edge in ("left", "right", "bottom"):
        scene.fix(edge, "y")
    scene.fix("bottom", "x")
    scene.traction("top", (2 * TAU, 0.0))
    return scene


def closed_form(layer: float, softening: float) -> tuple[float, float]:
    """Shear stress, and displacement of the top, at the displacement of the top of the weak layer."""
    # stress / mu + (tau - stress) / softening = layer
    fallen = (TAU / softening - layer) / (1 / softening - 1 / MU)
    stress = MU * layer if layer < TAU / MU else fallen
    return stress, layer + (LAYERS - 1) * stress / MU


def followed(scene, control, size, to):
    """The steps, and displacements of the top of the layer and of the column."""
    curve = []
    steps = tawami.follow(
        scene, control, size=size, to=to,
        each=lambda s: curve.append((s.load, *(s.displacement((0.5, y))[0] for y in (1.0, LAYERS)))),
    )  # fmt: skip
    return steps, np.array(curve)


# the top turns back (snap-back) where 3 softening > mu
@pytest.mark.parametrize(
    ("control", "softening"),
    [("layer", 20.0), ("layer", 60.0), ("arc length", 20.0)],
)
def test_a_softening_column_beyond_its_peak(control, softening):
    scene = column(softening)
    if control == "layer":
        steps, curve = followed(scene, ((0.5, 1.0), "x"), 0.002, 0.014)
    else:
        steps, curve = followed(scene, "arc length", 0.004, 0.040)
    assert steps.complete
    assert curve[:, 0].tolist() == steps.loads
    for load, layer, top in curve:
        stress, expected = closed_form(layer, softening)
        assert 2 * TAU * load == pytest.approx(stress, rel=1e-6)
        assert top == pytest.approx(expected, rel=1e-6)
    peak = steps.loads.index(max(steps.loads))
    assert peak < len(steps) - 2
    assert steps.loads[-1] < 0.47
    turned = np.diff(curve[peak + 1 :, 2])
    assert (turned < 0).all() if softening > MU / 3 else (turned > 0).all()
    assert scene.particles.stress[:, 3] == pytest.approx(2 * TAU * steps.reached, rel=1e-6)


def test_a_law_that_softens_warns_once_where_it_does():
    softer = np.flatnonzero(column(20.0).particles.x[:, 1] < 1.0)  # equally so
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        steps, _ = followed(column(20.0), ((0.5, 1.0), "x"), 0.002, 0.014)
        scene = column(0.0)  # ideal plasticity
        scene.fix("top", "x", 0.05)
        tawami.ramp(scene, 0.25)
    assert len(steps) > 5
    assert [w.category for w in caught] == [tawami.SofteningWarning]
    (number,) = re.findall("of particle ([0-9]+) has the eigenvalue -25 Pa", str(caught[0].message))
    assert int(number) in softer


def test_a_law_in_rust_that_softens_is_rejected():
    elastic = tawami.linear_elastic(E=1e3, nu=0.3)
    with pytest.raises(tawami.InputError, match="hardening = -1: .*softening needs a length scale"):
        tawami.von_mises(elastic, yield_stress=1.0, hardening=-1.0)


def test_a_ramp_stops_at_the_peak_and_says_how_to_continue():
    scene = column(20.0)
    with pytest.warns(
        tawami.IncompleteWarning, match=r"at 0\.\d+ of the load.*follow\(scene"
    ) as caught:
        steps = tawami.ramp(scene, 0.1, smallest=1e-3)
    assert caught[0].filename == __file__
    assert not steps.complete
    assert steps.reached == pytest.approx(0.5, abs=1e-3)
    assert isinstance(steps.error, tawami.ConvergenceError)
    # as the message advises: beyond the limit load, along the path
    steps, curve = followed(scene, ((0.5, 1.0), "x"), 0.002, 0.004)
    assert steps.complete
    stress, _ = closed_form(curve[-1, 1], 20.0)
    assert scene.particles.stress[:, 3] == pytest.approx(stress, rel=1e-6)


def test_wrong_input_of_a_path_raises_an_error():
    scene = column(20.0)
    for control in (None, "arc", "y", ((0.5, 1.0), "x", 1)):
        with pytest.raises(tawami.InputError, match="expected control='arc length', or"):
            tawami.follow(scene, control, size=0.1, to=1.0)
    with pytest.raises(tawami.InputError, match="expected a point within the grid"):
        tawami.follow(scene, ((0.5, 9.0), "x"), size=0.1, to=1.0)
    with pytest.raises(tawami.InputError, match="to = -1 m: expected a length"):
        tawami.follow(scene, "arc length", size=0.1, to=-1.0)
    with pytest.raises(tawami.ConvergenceError, match="choose another control"):
        tawami.follow(scene, ((0.5, 1.0), "y"), size=0.1, to=1.0, stop="raise")
    scene.fix("top", "x", 0.1)
    with pytest.raises(tawami.InputError, match="a displacement that the body does not have yet"):
        tawami.follow(scene, "arc length", size=0.1, to=1.0)
    grid = grid_of()
    scene = tawami.Scene(
        grid,
        tawami.box(grid, grid.origin, grid.upper, per_axis=2),
        tawami.linear_elastic(E=1.0, nu=0.3),
    )
    scene.fix("bottom", "x")
    scene.fix("bottom", "y")
    with pytest.raises(tawami.InputError, match="there is no new load"):
        tawami.follow(scene, "arc length", size=0.1, to=1.0)


def test_an_amplitude_that_continues_another_one_is_no_new_displacement():
    """As in a motion, what the old amplitude gave and the new one gives cancel."""
    grid = grid_of()
    body = tawami.box(grid, grid.origin, grid.upper, per_axis=2)
    scene = tawami.Scene(grid, body, tawami.linear_elastic(E=1e3, nu=0.3))
    scene.fix("bottom", "x")
    held = scene.fix("bottom", "y", 0.01, amplitude=lambda t: t)
    scene.solve(until=0.5)
    held.change(amplitude=lambda t: 0.5 + (t - 0.5) ** 2)
    scene.traction("top", (1.0, 0.0))
    control = ((0.0, 2.0), "x")
    steps = tawami.follow(scene, control, size=5e-4, to=1e-3)
    assert steps.complete
    held.change(amplitude=0.9)
    scene.traction("top", (1.0, 0.0))
    with pytest.raises(tawami.InputError, match="a displacement that the body does not have yet"):
        tawami.follow(scene, control, size=5e-4, to=1e-3)
