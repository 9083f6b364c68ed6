"""Initial fields from files: tables of scattered points, and particles of an earlier run."""

from __future__ import annotations

import meshio
import numpy as np
import pytest
from k0_column import LAWS, column, k0

import tawami
from tawami.results.single import write_particles


@pytest.fixture(scope="module")
def scene():
    """A scene for sources that are rejected, which leaves it as it is."""
    return column()


def write_table(path, points, values, header):
    rows = np.column_stack([points, values]).tolist()
    lines = [header, *(",".join(map(repr, row)) for row in rows)]
    path.write_text("\n".join(lines) + "\n")


def test_tables_are_linear_between_their_points(tmp_path):
    random = np.random.default_rng(0)
    points = np.concatenate([random.random((40, 2)), [[0, 0], [1, 0], [0, 1], [1, 1]]]) * [2, 4]
    stress = np.column_stack([*k0(*points.T, 0.6)[:3], 3 * points[:, 0]])
    path = tmp_path / "field.csv"
    write_table(path, points, stress, "x, y, sxx, syy, szz, sxy")
    scene = column()
    scene.initial("stress", tawami.table(path))
    x, y = scene.particles.x.T
    expected = np.column_stack([*k0(x, y, 0.6)[:3], 3 * x])
    assert scene.particles.stress == pytest.approx(expected, rel=1e-10, abs=1e-6)
    scene.initial("displacement", tawami.table(path, "sxy", "syy"))
    assert scene.particles.displacement[:, 0] == pytest.approx(3 * x)
    motion = tawami.Dynamics(scene, velocity=tawami.table(path, "sxy", "sxy"))
    assert motion.velocity[:, 1] == pytest.approx(3 * x)


def test_points_outside_a_table_are_rejected_or_take_the_nearest_value(tmp_path):
    path = tmp_path / "field.csv"
    write_table(
        path, [[0.2, 0], [2, 0], [2, 4], [0.2, 4]], [[1, 0], [2, 0], [3, 0], [4, 0]], "x,y,ux,uy"
    )
    scene = column()
    with pytest.raises(tawami.InputError, match=r"particle 0 at \(0.1.*outside='nearest'"):
        scene.initial("displacement", tawami.table(path))
    scene.initial("displacement", tawami.table(path, outside="nearest"))
    assert scene.particles.displacement[0, 0] == 1.0


def test_an_earlier_run_gives_its_fields(tmp_path):
    """The same particles take the values of the file, others interpolate linearly."""
    first = column("mohr_coulomb")
    first.initial("stress", lambda x, y: k0(x, y, 0.45))
    solution = first.solve()
    path = tmp_path / "particles.vtu"
    write_particles(path, solution)
    state = tawami.earlier(path)
    second = column("mohr_coulomb")
    for name in ("stress", "eps_v", "displacement"):
        second.initial(name, state)
    assert np.array_equal(second.particles.stress, solution.stress)
    assert np.array_equal(second.particles.eps_v, solution.eps_v)
    assert np.array_equal(second.particles.displacement, solution.displacement_of_particles)
    finer = column("mohr_coulomb", per_axis=3)
    with pytest.raises(tawami.InputError, match=r"stress: particle 0 at .* are outside the points"):
        finer.initial("stress", state)
    finer.initial("stress", tawami.earlier(path, outside="nearest"))
    inside = (abs(finer.particles.x - [1, 2]) < [0.85, 1.85]).all(axis=1)
    expected = np.column_stack(k0(*finer.particles.x.T, 0.45)[:3])
    assert finer.particles.stress[inside, :3] == pytest.approx(expected[inside], rel=1e-6)
    grid = first.grid
    again = tawami.Scene(grid, state.body, LAWS["mohr_coulomb"])
    assert np.array_equal(again.particles.x, solution.x)
    assert np.array_equal(again.particles.volume, solution.volume)
    with pytest.raises(
        tawami.InputError,
        match=r"has no column for velocity x, velocity y: it has 'displacement x \[m\]', ",
    ):
        tawami.Dynamics(column(), velocity=state)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "it is empty"),
        ("x,z,a\n1,2,3\n", "its header is x, z, a: expected names of columns, with the positions x"),
        ("x,y\n0,0\n1,0\n0,1\n", "has no column for eps_v: it has none. Expected a column 'ep"),
        ("x,y,eps_v\n0,0,1\n1,0,b\n0,1,1\n", "line 3, column 'eps_v': 'b': expected a finite"),
        ("x,y,eps_v\n0,0,1\n1,0\n0,1,1\n", "line 3 has 2 cells, and the header 3: 1,0: expected"),
        ("x,y,eps_v\n0,0,1\n1,0,nan\n0,1,1\n", "line 3, column 'eps_v': 'nan': expected a finite"),
        ("x,y,eps_v\n0,0,1\n1,0,1_000\n0,1,1\n", "line 3, column 'eps_v': '1_000': expected a fin"),
        ("x,y,eps_v\n0,0,1\n1,0,1\n", "has 2 points: expected three or more"),
        ("x,y,eps_v\n0,0,1\n1,0,1\n0,0,2\n", r"has 2 rows for the point \(0, 0\) m: expected one"),
        ("x,y,eps_v\n0,0,1\n0,1,1\n0,2,2\n", "do not form a triangle: .* np.interp"),
        ("x,y,a,b\n0,0,1,1\n0,1,1,1\n9,2,2,2\n", r"no column for eps_v: it has 'a', 'b'. Expected"),
        ("x,y,eps_v\n0,0,-1,000.5\n1,0,1,0\n0,1,2,0\n", "line 2 has 4 cells, and the header 3.*thou"),
        ('x,y,eps_v\n0,0,"0,5"\n1,0,1\n0,1,2\n', "line 2, column 'eps_v': '0,5': .* decimal point"),
        ("x;y;eps_v\n0;0;0,5\n1;0;1\n0;1;2\n", "is separated by semicolons: expected commas"),
        ("x,y,eps_v,eps_v\n0,0,1,2\n1,0,1,2\n0,1,1,2\n", "has 2 columns for one component"),
        ("x,y,x,eps_v\n0,0,1,2\n1,0,1,2\n0,1,1,2\n", "has 2 columns 'x', numbers 1, 3: expected na"),
        ("x,y,eps_v [kPa]\n0,0,1\n1,0,1\n0,1,1\n", r"the unit \[kPa\]: expected one of -, %"),
        ("x [ft],y,eps_v\n0,0,1\n1,0,1\n0,1,1\n", r"column 'x \[ft\]': the unit \[ft\]: exp"),
        ("x,y,z,eps_v\n0,0,0,1\n1,0,1,1\n0,1,0,1\n", "its points have different z: expected"),
        ('x,y,eps_v\n0,0,"1\n1,0,1\n0,1,1\n', "line 4: unexpected end of data"),
    ],
)  # fmt: skip
def test_a_wrong_table_is_rejected(scene, tmp_path, text, message):
    path = tmp_path / "field.csv"
    path.write_text(text)
    with pytest.raises(tawami.InputError, match=message):
        scene.initial("eps_v", tawami.table(path))


STATE = [-3e3, -5e3, -4e3, 5e2]
CORNERS = [[0, 0], [2, 0], [2, 4], [0, 4]]


@pytest.mark.parametrize(
    ("header", "row", "columns"),
    [
        ("x,y,S12,S11,S33,S22", [500, -3000, -4000, -5000], ()),
        ("x,y,sxx [kPa],syy [kPa],szz [MPa],sxy (Pa)", [-3, -5, -4e-3, 500], ()),
        ("# X, Y,sigma_xx_kPa,sigma_yy_kPa,sigma_zz_kPa,sigma_xy_kPa", [-3, -5, -4, 0.5], ()),
        ("x,y,name,stress xx,stress yy,stress zz,stress xy", [7, -3000, -5000, -4000, 500], ()),
        ("x,y,xx,yy,zz,xy,yx,xz", [*STATE, 500, 0], ()),
        ("x,y,a [N/mm²],b [Pa],c [Pa],d [Pa]", [-3e-3, *STATE[1:]], ("a", "b", "c", "d")),
        ("x,y,a,b,d,c", [-3000, -5000, 500, -4000], ("a", "b", "c", "d")),
    ],
)
def test_columns_of_a_table_are_found_by_name_and_converted(tmp_path, header, row, columns):
    path = tmp_path / "field.csv"
    write_table(path, CORNERS, [row] * 4, header)
    scene = column()
    scene.initial("stress", tawami.table(path, *columns))
    assert scene.particles.stress == pytest.approx(np.tile(STATE, (128, 1)), rel=1e-9)


@pytest.mark.parametrize("unit", ["[1]", "[-]", "(1)", ""])
def test_numbers_without_a_unit_have_several_labels(tmp_path, unit):
    path = tmp_path / "field.csv"
    write_table(path, CORNERS, [[0], [0.2], [0.2], [0]], f"x,y,eps_v {unit}")
    scene = column("mohr_coulomb")
    scene.initial("eps_v", tawami.table(path))
    assert scene.particles.eps_v == pytest.approx(0.1 * scene.particles.x[:, 0])


def test_positions_in_millimetres_are_converted(tmp_path):
    path = tmp_path / "field.csv"
    write_table(path, 1e3 * np.array(CORNERS), [[0], [20], [20], [0]], "x [mm],y [mm],eps_v [%]")
    scene = column("mohr_coulomb")
    scene.initial("eps_v", tawami.table(path))
    assert scene.particles.eps_v == pytest.approx(0.1 * scene.particles.x[:, 0])


@pytest.mark.parametrize(
    ("header", "columns", "message"),
    [
        ("x,y,sxx,syy,sxy,tzz", (), "no column for stress zz: it has .* present names in order"),
        ("x,y,sxx,syy,szz,S11", (), "no column for stress xy"),
        ("x,y,sxx,syy,szz,sxy", ("sxx", "sxy", "syy", "szz"), "'syy' is component yy: expected"),
        ("x,y,sxx,syy,szz,sxy", ("sxx", "syy", "szz"), r"expected 4 columns \(xx yy zz xy\)"),
        ("x,y,sxx [kPa],syy,szz,sxy", (), "'syy', 'szz', 'sxy' of .* have no unit, and other columns"),
        ("x,y,sxx psi,syy,szz,sxy", (), "no column for stress xx: it has 'sxx psi'"),
        ("x,y,sxx [psi],syy [Pa],szz [Pa],sxy [Pa]", (), r"'sxx \[psi\]': the unit \[psi\]: expected"),
        ("x,y,a [mPa],syy [Pa],szz [Pa],sxy [Pa]", ("a", "syy", "szz", "sxy"), r"unit \[mPa\]: e"),
        ("x,y,sxx,syy,szz,sxy", ("s",), "has no column 's': expected one of 'x', 'y', 'sxx'"),
    ],
)  # fmt: skip
def test_columns_that_do_not_fit_a_field_are_rejected(scene, tmp_path, header, columns, message):
    path = tmp_path / "field.csv"
    write_table(path, CORNERS, [STATE] * 4, header)
    with pytest.raises(tawami.InputError, match=message):
        scene.initial("stress", tawami.table(path, *columns))


# -- particles of another program --------------------------------------------------


def particles(path, z=0.0, **arrays):
    """Write the corners of the column with an array on them, in the manner of meshio."""
    points = np.column_stack([CORNERS, z * np.arange(4)])
    data = {name: np.array([row] * 4, float) for name, row in arrays.items()}
    meshio.Mesh(points, [("vertex", np.arange(4)[:, None])], point_data=data).write(path)
    return tawami.earlier(path)


FULL = [-3e3, 5e2, 0, 5e2, -5e3, 0, 0, 0, -4e3]


@pytest.mark.parametrize(
    "arrays",
    [
        {"stress": FULL},
        {"stress [kPa]": [1e-3 * value for value in FULL]},
        {"S": FULL, "stress old": [1.0, 2.0, 3.0, 4.0]},
        {"stress xy zz yy xx [Pa]": STATE[::-1]},
        {f"stress_{c}": value for c, value in zip(("xx", "yy", "zz", "xy"), STATE, strict=True)},
    ],
)
def test_tensors_of_other_programs_are_mapped_by_their_components(tmp_path, arrays):
    scene = column()
    scene.initial("stress", particles(tmp_path / "other.vtu", **arrays))
    assert scene.particles.stress == pytest.approx(np.tile(STATE, (128, 1)), rel=1e-9)


@pytest.mark.parametrize(
    ("field", "arrays", "message"),
    [
        ("stress", {"stress": STATE}, r"The components of 'stress' have no names: expected all"),
        ("stress", {"stress": [*STATE, 0, 0]}, r"as 'stress xx yy zz xy \[Pa\]'"),
        ("stress", {"stress": [1, 2, 3]}, "no column for stress xx, stress yy, stress zz, stress xy"),
        ("stress", {"stress": [1, 2, 0, 3, 1, 0, 0, 0, 1]}, "'stress yx' of .* is not equal to xy in"),
        ("stress", {"stress": [1, 0, 2, 0, 1, 0, 2, 0, 1]}, "'stress xz' of .* is not 0 in plane"),
        ("displacement", {"displacement": [1, 2, 3]}, "'displacement z' of .* is not 0 in plane"),
        ("eps_v", {"eps_v": [1, 2]}, "no column for eps_v: it has 'eps_v x', 'eps_v y'"),
        ("stress", {"stress [ksi]": FULL}, r"column 'stress xx \[ksi\]': the unit \[ksi\]: exp"),
    ],
)  # fmt: skip
def test_arrays_of_other_programs_that_do_not_fit_are_rejected(
    scene, tmp_path, field, arrays, message
):
    with pytest.raises(tawami.InputError, match=message):
        scene.initial(field, particles(tmp_path / "other.vtu", **arrays))


def test_points_of_other_programs_lie_in_a_plane(tmp_path):
    with pytest.raises(
        tawami.InputError, match="its points have different z: expected points in one"
    ):
        particles(tmp_path / "other.vtu", z=1.0)


def test_the_name_that_a_message_suggests_is_read(tmp_path):
    scene = column()
    scene.initial("stress", particles(tmp_path / "other.vtu", **{"stress xx yy zz xy [Pa]": STATE}))
    assert scene.particles.stress == pytest.approx(np.tile(STATE, (128, 1)), rel=1e-9)


def test_particles_of_an_earlier_run_are_known_by_their_number(tmp_path):
    scene = column("mohr_coulomb")
    p, order = scene.particles, np.arange(128)[::-1]
    points = np.pad(p.x[order], ((0, 0), (0, 1)))
    data = {"number [-]": np.asarray(p.number, float)[order], "eps_v [-]": np.sin(7.0 * order)}
    path = tmp_path / "particles.vtu"
    meshio.Mesh(points, [("vertex", np.arange(128)[:, None])], point_data=data).write(path)
    scene.initial("eps_v", tawami.earlier(path))
    assert np.array_equal(p.eps_v, np.sin(7.0 * np.arange(128)))


def test_missing_files_are_named(tmp_path):
    with pytest.raises(tawami.InputError, match=r"table\('.*none.csv'\) cannot be read"):
        tawami.table(tmp_path / "none.csv")
    with pytest.raises(tawami.InputError, match=r"earlier\('.*none.vtu'\) cannot be read"):
        tawami.earlier(tmp_path / "none.vtu")
    (tmp_path / "text.vtu").write_text("no particles")
    with pytest.raises(tawami.InputError, match=r"earlier\('.*text.vtu'\) cannot be read"):
        tawami.earlier(tmp_path / "text.vtu")
    with pytest.raises(tawami.InputError, match="outside = 'far': expected 'stop' or 'nearest'"):
        tawami.table("any.csv", outside="far")
