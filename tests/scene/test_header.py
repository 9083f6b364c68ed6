"""The header of a scene: what is modelled, how much of it, and what is not modelled."""

from __future__ import annotations

import re

import pytest
from scenes import grid_of
from standing_block import ELASTIC, moving, plastic, scene_of, tresca

import tawami


def line(header, label):
    """The text after a label of a header, over several lines."""
    text = re.sub(r"\n +", " ", header)
    return re.search(rf"^{label} +(.*)$", text, flags=re.MULTILINE).group(1)


@pytest.mark.parametrize("assembly", ["points", "dolfinx"])
def test_the_header_counts_particles_bytes_and_unknowns(assembly):
    scene = scene_of(form="u_epsv", assembly=assembly)
    scene.hold((0.0, 1.7), "x", 0.01)
    header = scene.header()
    # 6 x 5 splines in two components, 5 x 4 bilinear functions; 12 along the edge, one by the point
    assert line(header, "unknowns").startswith("67: 60 of u, 20 of eps_v, minus 13 prescribed")
    assert scene.solve().unknowns == 67
    assert scene.header() == header
    assert line(header, "particles").startswith("48, 120 bytes each (x 16, volume 8,")
    assert "5.76 kB in total" in header
    assert line(header, "solver").endswith(f"assembly {assembly}, 1 rank")
    assert line(header, "supports") == (
        "fix('bottom') x, fix('bottom') y, hold(point=(0.0, 1.7)) x = 0.01 m"
    )
    data = scene.configuration.domain.responses.data["particle"]
    # sigma 3 and its derivatives 3 x (3 + 1), K, K^2/mu; and K and mu themselves
    assert data.shape[1] == 3 + 12 + 2
    assert f"{8 * (17 + 2 + 2)} more bytes each" in line(header, "particles")


def test_only_cells_with_particles_have_unknowns():
    grid = grid_of()
    body = tawami.box(grid, grid.origin, (0.0, 1.5), per_axis=2)
    scene = tawami.Scene(grid, body, tawami.linear_elastic(**ELASTIC), form="u")
    assert line(scene.header(), "grid").startswith(
        "4 x 3 cells of 0.5 m from (-1, 0.5) to (1, 2), 4 "
    )
    assert line(scene.header(), "unknowns").startswith(
        "32: 32 of u, minus 0 prescribed"
    )  # 4 x 4 splines


def switched(**options):
    """The header of a static scene with one option more."""
    return lambda: scene_of(**{"form": "u"} | options).header()


def with_call(call, **options):
    """The header of a static scene after a call."""

    def header():
        scene = scene_of(form="u", density=1.0, **options)
        call(scene)
        return scene.header()

    return header


@pytest.mark.parametrize(
    ("words", "header"),
    [
        ("inertia", lambda: moving(form="u").header()),
        ("finite strain", switched(form="u_epsv_finite")),
        ("plasticity", switched(law=tresca())),
        ("a field for the volume", switched(form="u_epsv")),
        ("contact", with_call(lambda scene: scene.wall("left"))),
        ("weight", with_call(lambda scene: scene.gravity((0.0, -1.0)))),
    ],
)
def test_each_option_leaves_the_list_of_what_is_not_modelled(words, header):
    assert words in line(switched()(), "not modelled")
    missing = re.findall(r"[\w ]+(?= \()", line(header(), "not modelled"))
    assert words not in [name.strip() for name in missing]


def test_the_header_shows_a_ghost_penalty_and_a_motion():
    assert (
        "ghost penalty (ghost_penalty='on')"
        in scene_of(form="u_epsv", ghost_penalty="off").header()
    )
    ghost = scene_of(form="u_epsv", ghost_penalty="on").header()
    assert "ghost_penalty 'on'" in line(ghost, "form")
    assert "k = 0.003" in line(ghost, "form")
    assert "ghost" not in line(ghost, "not modelled")
    motion = moving(law=plastic(), form="u_epsv_finite")
    motion.scene.load([0, 1, 2], (0.0, 1.0))
    header = motion.header()
    assert line(header, "models") == (
        "inertia, finite strain, particles that move, laws drucker_prager (plastic_strain, dilatancy)"
    )
    assert "transfer affine_flip, damping none" in line(header, "motion")
    assert line(header, "loads") == "force on 3 particles"
    assert "velocity_gradient 32" in line(header, "particles")
    assert "statics between the steps of a motion" in motion.scene.header()
    assert "velocities stay on the grid" in moving(form="u").header()
