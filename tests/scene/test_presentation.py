"""Solutions as pictures, tables and meshes, and scenes as text in a notebook."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
import pytest
from mpi4py import MPI

import tawami
from tawami.base import html
from tawami.picture import style
from tawami.quantities import presentation

Q = tawami.Quantity


@pytest.fixture(scope="module")
def small():
    """A block under pressure, with small strain and displacements of 10 % in the picture."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0.0, 0.0), h=0.5, cells=(4, 2))
    body = tawami.box(grid, (0.0, 0.0), (2.0, 1.0), per_axis=2)
    scene = tawami.Scene(grid, body, tawami.linear_elastic(E=1e7, nu=0.3), form="u_epsv")
    scene.fix("bottom", "y")
    scene.fix("left", "x")
    scene.traction("top", (0.0, -1e4))
    return scene.solve()


@pytest.fixture(scope="module")
def finite():
    """A plastic block that falls and turns freely."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0.0, 0.0), h=0.5, cells=(6, 6))
    body = tawami.box(grid, (1.0, 1.0), (2.0, 2.0), per_axis=2)
    clay = tawami.von_mises(tawami.linear_elastic(E=1e5, nu=0.3), yield_stress=1e3)
    scene = tawami.Scene(grid, body, clay, form="u_epsv_finite", density=1e3)
    motion = tawami.Dynamics(scene, velocity=lambda x, y: (1.5 - y, x - 1.5))
    return motion.step(0.1)


@pytest.fixture(autouse=True)
def _closed():
    yield
    plt.close("all")


def shown(axes):
    """Vertices and values of the particles of a picture."""
    (squares,) = (c for c in axes.collections if c.get_array() is not None)
    corners = np.array([path.vertices[:4] for path in squares.get_paths()])
    return corners, np.asarray(squares.get_array()), squares


def area(corners):
    x, y = corners[..., 0], corners[..., 1]
    return 0.5 * np.abs((x * np.roll(y, -1, 1) - y * np.roll(x, -1, 1)).sum(axis=1))


def test_a_picture_has_particles_units_and_a_colour_bar(small):
    axes = small.plot()
    corners, values, squares = shown(axes)
    np.testing.assert_allclose(values, small.mean_stress / 1e3)
    np.testing.assert_allclose(corners.mean(axis=1), small.x + small.displacement_of_particles)
    np.testing.assert_allclose(area(corners), small.volume)
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("$x$ [m]", "$y$ [m]")
    assert axes.get_title() == "mean stress"
    assert squares.colorbar.ax.get_xlabel() == "mean stress [kPa]"
    assert axes.get_figure() is plt.gcf()


def test_the_title_is_inside_the_picture(small):
    figure = small.plot(deformed=10).figure
    figure.canvas.draw()
    assert figure.axes[0].title.get_window_extent().y1 < figure.bbox.y1


@pytest.mark.parametrize(("factor", "title"), [(0.0, "at the start"), (50.0, "displacements x 50")])
@pytest.mark.parametrize("kind", ["small", "finite"])
def test_displacements_are_enlarged_by_a_factor(kind, factor, title, request):
    solution = request.getfixturevalue(kind)
    axes = solution.plot("displacement y", deformed=factor, limits=(-0.1, 0.1))
    u = solution.displacement_of_particles
    start = solution.x - u * (kind == "finite")
    corners, values, squares = shown(axes)
    np.testing.assert_allclose(corners.mean(axis=1), start + factor * u, atol=1e-12)
    np.testing.assert_allclose(values, u[:, 1])
    assert squares.get_clim() == (-0.1, 0.1)
    assert axes.get_title() == f"displacement y, {title}"


def test_particles_of_finite_strain_are_drawn_with_their_deformation(finite):
    corners, _, _ = shown(finite.plot("velocity"))
    f = np.eye(2) + finite.arrays.displacement_gradient
    np.testing.assert_allclose(area(corners), finite.volume * np.linalg.det(f))


def test_quantities_of_stress_and_displacement_can_be_drawn(finite):
    (left, right), s = plt.subplots(1, 2)[1], finite.stress
    for name, expected in {
        "stress xy": s[:, 3], "deviatoric stress q": finite.arrays.deviatoric_stress_q,
        "strain yy": finite.strain[:, 1], "plastic_strain": finite.arrays.plastic_strain,
        "displacement": np.linalg.norm(finite.displacement_of_particles, axis=1),
        "velocity x": finite.arrays.velocity[:, 0],
    }.items():  # fmt: skip
        right.clear()
        assert finite.plot(name, right) is right
        np.testing.assert_allclose(shown(right)[1], expected)
        assert name in right.child_axes[0].get_ylabel()
    shear = Q("largest shear stress [Pa]", lambda p: np.hypot(p.stress[:, 0] / 2, p.stress[:, 3]))
    np.testing.assert_allclose(shown(finite.plot(shear, left))[1], np.hypot(s[:, 0] / 2, s[:, 3]))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            ("strss",),
            r"quantity: 'strss' is unknown: expected one of displacement, stress, mean st",
        ),
        (("stress",), r"'stress' is not one number: expected one of 'stress xx', 'stress yy', "),
        (("stress yx",), r"'stress yx' is not one number: expected one of 'stress xx', "),
        ((3,), r"quantity: '3' is unknown"),
        (("velocity",), r"no array 'velocity': the scene is static. Dynamics"),
        (("plastic_strain",), r"the laws of this scene have no history"),
        (("mean stress", "axes"), r"plot: axes = 'axes': expected axes of matplotlib, or None"),
        (
            (Q("my stress [Pa]", lambda p: p.stress[1:]),),
            r"quantity 'my stress \[Pa\]': .*\(31, 4\)",
        ),
    ],
)
def test_what_cannot_be_drawn_is_rejected(small, arguments, message):
    with pytest.raises(tawami.InputError, match=message):
        small.plot(*arguments)
    for options, expected in (
        ({"limits": (1, 1)}, r"limits\[1\] = 1"),
        ({"deformed": "a"}, "deformed"),
    ):
        with pytest.raises(tawami.InputError, match=expected):
            small.plot(**options)


def test_a_table_has_a_column_for_each_component(finite):
    table = presentation.columns(finite.arrays, (), *finite._usual())
    assert list(table)[:6] == [
        "x [m]", "y [m]", "displacement x [m]", "displacement y [m]", "stress xx [Pa]", "stress yy [Pa]"
    ]  # fmt: skip
    assert {"mean stress [Pa]", "strain xy [-]", "plastic_strain [-]", "velocity y [m/s]"} <= set(
        table
    )
    assert all(column.shape == finite.number.shape for column in table.values())
    np.testing.assert_array_equal(table["stress xy [Pa]"], finite.stress[:, 3])
    half = Q("half [m]", lambda p: p.x / 2)
    table = presentation.columns(finite.arrays, ("eps_v", half), *finite._usual())
    assert list(table) == ["x [m]", "y [m]", "eps_v [-]", "half x [m]", "half y [m]"]
    with pytest.raises(
        tawami.InputError, match="quantity 'half': expected a tawami.Quantity or one"
    ):
        finite.to_pandas("half")


def test_fields_of_a_mesh_have_vectors_in_space(finite):
    data = presentation.fields(finite.arrays, ("velocity", "stress"), *finite._usual())
    np.testing.assert_array_equal(data["velocity [m/s]"][:, :2], finite.arrays.velocity)
    assert not data["velocity [m/s]"][:, 2].any()
    np.testing.assert_array_equal(data["stress xx yy zz xy [Pa]"], finite.stress)


@pytest.mark.parametrize(
    ("package", "call", "purpose"),
    [
        ("matplotlib", "plot()", "pictures need"),
        ("pandas", "to_pandas()", r"solution.to_pandas\(\) needs"),
        ("pyvista", "to_pyvista()", r"solution.to_pyvista\(\) needs"),
    ],
)
def test_a_missing_package_is_named(small, package, call, purpose, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, package, None)
    with pytest.raises(
        tawami.MissingDependencyError, match=rf"{purpose} {package}: pip install {package}"
    ):
        getattr(small, call.removesuffix("()"))()


@pytest.mark.slow
def test_pandas_and_pyvista_get_the_particles(finite):
    frame = finite.to_pandas()
    np.testing.assert_array_equal(frame.index, finite.number)
    np.testing.assert_array_equal(frame["mean stress [Pa]"], finite.mean_stress)
    cloud = finite.to_pyvista()
    np.testing.assert_array_equal(cloud.points[:, :2], finite.x.astype(cloud.points.dtype))
    assert cloud.active_scalars_name == "mean stress [Pa]"
    np.testing.assert_array_equal(cloud["stress xx yy zz xy [Pa]"], finite.stress)


def test_scenes_and_solutions_describe_themselves_in_html(small, finite):
    text = small._repr_html_()
    for part in ("Solution", "u_epsv", ">32<", ">Newton<", ">momentum<", ">volume<"):
        assert part in text
    text = finite.scene._repr_html_()
    for line in finite.scene.header().splitlines():
        assert line.split()[0].split("<")[0] in text
    for part in ("6 x 6 cells", "von_mises", "&#x27;u_epsv_finite&#x27;"):
        assert part in text


def test_html_is_escaped():
    text = html.table("a < b", {"<script>": "1 & 2", "empty": ""})
    assert "&lt;script&gt;" in text
    assert "a &lt; b" in text
    assert "1 &amp; 2" in text
    assert "empty" not in text


def test_the_style_is_left_as_it_was(small):
    before = dict(plt.rcParams)
    small.plot()
    assert dict(plt.rcParams) == before
    assert style.labelled("stress", "Pa") == "stress [Pa]"
