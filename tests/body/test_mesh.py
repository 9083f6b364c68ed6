"""Bodies of meshes: each group has the moments of its elements in every format; error messages."""

from __future__ import annotations

import warnings
from time import perf_counter

import meshio
import moments
import numpy as np
import pytest
from mpi4py import MPI
from scenes import grid_of
from scipy.spatial import Delaunay

import tawami

CLAY, SAND = 7, 3  # numbers of the physical groups
NAMES = {"clay": np.array([CLAY, 2]), "sand": np.array([SAND, 2])}


def quads(nx=5, ny=4, size=(1.7, 1.1), turn=0.2, place=(-0.75, 0.55)):
    """A rotated rectangle of squares, and the group of each: sand below, clay above."""
    x, y = np.meshgrid(np.linspace(0, size[0], nx + 1), np.linspace(0, size[1], ny + 1))
    c, s = np.cos(turn), np.sin(turn)
    points = np.column_stack([(c * x - s * y).ravel(), (s * x + c * y).ravel()]) + place
    corner = (np.arange(nx) + (nx + 1) * np.arange(ny)[:, None]).ravel()
    cells = corner[:, None] + [0, 1, nx + 2, nx + 1]
    return points, cells, np.where(corner // (nx + 1) < ny / 2, SAND, CLAY)


def triangles(**options):
    points, cells, tag = quads(**options)
    return points, np.concatenate([cells[:, :3], cells[:, [0, 2, 3]]]), np.tile(tag, 2)


def made(points, kind, cells, tag=None, names=NAMES, z=0.0, **options):
    data = {} if tag is None else {"gmsh:physical": [tag], "gmsh:geometrical": [tag]}
    in_space = np.column_stack([points, np.full(len(points), z)])
    return meshio.Mesh(in_space, [(kind, cells)], cell_data=data, field_data=names, **options)


def second_order(points, cells):
    """The elements with a node in the middle of each side."""
    n, m = cells.shape
    middle = (points[cells] + points[np.roll(cells, -1, axis=1)]) / 2
    numbers = len(points) + np.arange(n * m).reshape(n, m)
    return np.concatenate([points, middle.reshape(-1, 2)]), np.concatenate([cells, numbers], axis=1)


def check(body, points, cells, tag):
    assert body.names == ("sand", "clay")
    for number, group in enumerate((SAND, CLAY)):
        exact = moments.of_polygons(points[cells[tag == group]])
        found = moments.of_particles(body, body.material_of == number)
        assert found == pytest.approx(exact, rel=1e-12, abs=1e-14)
    assert (body.volume > 0).all()


@pytest.mark.parametrize("kind", ["triangle", "quad", "triangle6", "quad8"])
def test_moments_of_each_group(kind):
    points, cells, tag = triangles() if kind.startswith("tri") else quads()
    if kind[-1].isdigit():
        nodes, elements = second_order(points, cells)
        body = tawami.mesh(
            grid_of(), made(nodes, kind, elements, tag, z=3.0), gauss=True, per_axis=2
        )
    else:
        body = tawami.mesh(grid_of(), made(points, kind, cells, tag), gauss=True, per_axis=2)
    check(body, points, cells, tag)


def gmsh_41(points, cells, tag):
    """A file as written by Gmsh: blocks of elements name entities, and these their physical groups."""
    lines = ["$MeshFormat", "4.1 0 8", "$EndMeshFormat", "$PhysicalNames", "2", f'2 {SAND} "sand"',
             f'2 {CLAY} "clay"', "$EndPhysicalNames", "$Entities", "0 0 2 0",
             f"1 -1 0 0 1 2 0 1 {SAND} 0", f"2 -1 0 0 1 2 0 1 {CLAY} 0", "$EndEntities", "$Nodes",
             f"1 {len(points)} 1 {len(points)}", f"2 1 0 {len(points)}"]  # fmt: skip
    lines += [f"{k + 1}" for k in range(len(points))]
    lines += [f"{x!r} {y!r} 0" for x, y in points.tolist()]
    lines += ["$EndNodes", "$Elements", f"2 {len(cells)} 1 {len(cells)}"]
    for entity, group in ((1, SAND), (2, CLAY)):
        mine = cells[tag == group] + 1
        lines += [f"2 {entity} 2 {len(mine)}"]
        lines += [f"{k + 1 + (entity - 1) * 1000} {a} {b} {c}" for k, (a, b, c) in enumerate(mine)]
    return "\n".join([*lines, "$EndElements", ""])


@pytest.mark.parametrize("format", ["gmsh22", "gmsh 4.1", "vtu", "vtk"])
def test_files(tmp_path, format):
    points, cells, tag = triangles(nx=9, ny=8)
    mesh = made(points, "triangle", cells, tag)
    path = tmp_path / f"body.{format}"
    if format == "gmsh 4.1":
        path = tmp_path / "body.msh"
        path.write_text(gmsh_41(points, cells, tag))
    elif format == "gmsh22":
        path = tmp_path / "body.msh"
        meshio.write(path, mesh, file_format=format, binary=False)
    else:
        meshio.write(path, mesh)
    body = tawami.mesh(grid_of(), path, gauss=True, per_axis=2)
    if not format.startswith("gmsh"):  # these formats have numbers only
        assert body.names == ("3", "7")
        body = tawami.Body(body.x, body.volume, body.material_of, ("sand", "clay"))
    check(body, points, cells, tag)


def test_cell_sets_and_meshes_without_groups():
    points, cells, tag = quads()
    sets = {"sand": [np.flatnonzero(tag == SAND)], "clay": [np.flatnonzero(tag == CLAY)]}
    body = tawami.mesh(
        grid_of(), made(points, "quad", cells, cell_sets=sets), gauss=True, per_axis=2
    )
    check(body, points, cells, tag)
    plain = tawami.mesh(grid_of(), made(points, "quad", cells), gauss=True, per_axis=2)
    assert plain.names == ()
    assert moments.of_particles(plain) == pytest.approx(
        moments.of_polygons(points[cells]), rel=1e-12
    )


def test_a_mesh_has_the_moments_of_the_polygon_around_it():
    points, cells, _ = quads(nx=11, ny=7)
    corners = points[[0, 11, 12 * 8 - 1, 12 * 7]]
    grid = grid_of((8, 6), h=0.25)
    body = tawami.mesh(grid, made(points, "quad", cells), per_axis=2)
    polygon = tawami.polygon(grid, corners, per_axis=2)
    assert moments.of_particles(body) == pytest.approx(moments.of_particles(polygon), rel=1e-12)


def test_concave_quadrilaterals_and_clockwise_ones():
    points = np.array(
        [[-0.9, 0.6], [0.2, 0.7], [-0.5, 0.9], [-0.6, 1.9]]
    )  # node 2 is inside the triangle of the others
    body = tawami.mesh(
        grid_of(), made(points, "quad", np.array([[3, 2, 1, 0]])), gauss=True, per_axis=2
    )
    exact = moments.of_polygons(points[[[0, 1, 2, 3]]])
    assert moments.of_particles(body) == pytest.approx(exact, rel=1e-12)


def test_materials_by_name_or_in_the_order_of_the_numbers():
    points, cells, tag = triangles()
    grid = grid_of()
    body = tawami.mesh(grid, made(points, "triangle", cells, tag), per_axis=2)
    clay, sand = tawami.linear_elastic(E=1e5, nu=0.4), tawami.linear_elastic(E=4e5, nu=0.2)
    named = tawami.Scene(
        grid, body, {"clay": clay, "sand": sand}, density={"sand": 2e3, "clay": 1e3}
    )
    listed = tawami.Scene(grid, body, [sand, clay], density=[2e3, 1e3])
    for scene in (named, listed):
        stiff = scene.configuration.domain.constants["mu"] == sand.shear_modulus
        assert stiff.any()
        assert (stiff == (body.material_of == 0)).all()
        areas = [moments.of_polygons(points[cells[tag == group]])[0] for group in (SAND, CLAY)]
        assert scene.mass.sum() == pytest.approx(2e3 * areas[0] + 1e3 * areas[1])
    mine = tawami.Scene(grid, body, clay, material_of=np.zeros(len(body.x)))
    assert np.ptp(mine.configuration.domain.constants["mu"]) == 0


@pytest.mark.parametrize(
    ("material", "options", "message"),
    [
        ({"clay": 0}, {}, r"material has nothing for 'sand': expected one for each of 'sand', 'clay'"),
        ({"clay": 0, "sand": 0, "silt": 0}, {}, r"material has 'silt', which the body does not have"),
        ([0], {}, r"1 material for a body with 2 names, 'sand', 'clay': expected one for each"),
        ([0, 0, 0], {}, r"3 materials for a body with 2 names"),
        (0, {}, r"1 material for a body with 2 names.*material_of=np.zeros"),
        ({"clay": 0, "sand": 0}, {"density": {"clay": 1.0}}, "density has nothing for 'sand'"),
        ({"clay": 0, "sand": 0}, {"material_of": [0]}, "dictionary and material_of is given too"),
    ],
)  # fmt: skip
def test_error_messages_of_materials_by_name(material, options, message):
    law = tawami.linear_elastic(E=1e5, nu=0.4)
    if isinstance(material, dict):
        material = dict.fromkeys(material, law)
    else:
        material = [law] * len(material) if isinstance(material, list) else law
    points, cells, tag = triangles()
    body = tawami.mesh(grid_of(), made(points, "triangle", cells, tag), per_axis=2)
    with pytest.raises(tawami.InputError, match=message):
        tawami.Scene(grid_of(), body, material, **options)


def test_a_dictionary_for_a_body_without_names():
    grid = grid_of()
    box = tawami.box(grid, grid.origin, grid.upper, per_axis=2)
    law = tawami.linear_elastic(E=1e5, nu=0.4)
    with pytest.raises(tawami.InputError, match="dictionary and the body has no names"):
        tawami.Scene(grid, box, {"clay": law})


def test_warning_of_curved_sides():
    points, cells, _ = triangles()
    nodes, elements = second_order(points, cells)
    nodes[len(points)] += 0.01
    with pytest.warns(tawami.GeometryWarning, match=r"curved sides, by up to 0.04\d* of a side"):
        body = tawami.mesh(grid_of(), made(nodes, "triangle6", elements), gauss=True, per_axis=2)
    assert body.volume.sum() == pytest.approx(1.7 * 1.1, rel=1e-12)


def wrong(what):
    """A mesh with a mistake."""
    points, cells, tag = triangles()
    kind = "triangle"
    match what:
        case "outside":
            points[:, 0] += 0.8
        case "inverted":  # a node is pushed through the opposite side
            points[8] += [0.9, 0.05]
        case "twice":
            cells, tag = np.concatenate([cells, cells[:1]]), np.append(tag, CLAY)
        case "two bodies":
            cells = np.concatenate([cells, cells + len(points)])
            points, tag = np.concatenate([points, points * 0.5 + [0.1, 0.5]]), np.tile(tag, 2)
        case "flat":
            points[cells[0, 1]] = points[cells[0, 0]]
        case "twisted":
            points, cells, tag = quads()
            cells, kind = cells[:, [0, 2, 1, 3]], "quad"
        case "solid":
            cells, kind = np.array([[0, 1, 2, 8]]), "tetra"
        case "lines":
            cells, kind = cells[:, :2], "line"
        case "nan":
            points[3] = np.nan
    mesh = made(points, kind, cells, tag if len(tag) == len(cells) else None)
    if what == "not plane":
        mesh.points[4, 2] = 0.5
    if what == "sets":
        mesh = made(points, kind, cells, cell_sets={"clay": [np.arange(4)]})
    if what == "two sets":
        both = {"clay": [np.arange(len(cells))], "sand": [np.array([3])]}
        mesh = made(points, kind, cells, cell_sets=both)
    return mesh


@pytest.mark.parametrize(
    ("what", "message"),
    [
        ("outside", r"element \d+ has a node at \(.*\) m, outside the grid, \[-1, 1\] x \[0.5, 2\]"),
        ("nan", r"element \d+ has a node at \(nan, nan\) m, outside the grid"),
        ("inverted", r"elements \d+ and \d+ overlap by 0.0\d+ m2 near \(.*turned inside out"),
        ("twice", r"elements 0 and 40 overlap by 0.046[78] m2 near"),
        ("two bodies", r"elements \d+ and \d+ overlap"),
        ("flat", r"\d+ of its elements have no area, the first is element 0"),
        ("twisted", r"20 of its quadrilaterals cross themselves, the first is element 0"),
        ("solid", r"holds elements 'tetra': expected triangles and quadrilaterals"),
        ("lines", r"holds line: expected triangles or quadrilaterals"),
        ("not plane", r"nodes have z from 0 to 0.5 m: expected a plane mesh"),
        ("sets", r"36 of its elements, the first is 4, are in none of the cell sets \('clay'\)"),
        ("two sets", r"several cell sets, the first, element 3, in 'clay' and 'sand': expected each in"),
    ],
)  # fmt: skip
def test_error_messages(what, message):
    with pytest.raises(tawami.InputError, match=message):
        tawami.mesh(grid_of(), wrong(what), per_axis=2)


def test_files_that_cannot_be_read(tmp_path):
    with pytest.raises(tawami.InputError, match=r"'.*none.msh' cannot be read .*: expected a mesh"):
        tawami.mesh(grid_of(), tmp_path / "none.msh", per_axis=2)
    for name in ("text.msh", "text.vtu", "text.unknown"):
        (tmp_path / name).write_text("no mesh")
        with pytest.raises(
            tawami.InputError, match=rf"{name}' cannot be read .*: expected a complete"
        ):
            tawami.mesh(grid_of(), tmp_path / name, per_axis=2)
    with pytest.raises(tawami.InputError, match="source = 3: expected the path of a mesh file"):
        tawami.mesh(grid_of(), 3, per_axis=2)
    points, cells, tag = triangles()
    mesh = made(points, "triangle", cells, tag)
    with pytest.raises(tawami.InputError, match="no such cell data: .*'gmsh:physical'"):
        tawami.mesh(grid_of(), mesh, tags="layer", per_axis=2)


SQUARE = np.array([[0, 1.0], [0.5, 1.0], [0.5, 1.5], [0, 1.5]])


@pytest.mark.parametrize(
    ("nodes", "data", "options", "message"),
    [
        ([1, 2, 3, 4], {}, {}, "nodes 1 to 4: expected numbers from 0 to 3, as there are 4 nodes"),
        ([-1, 0, 1, 2], {}, {}, "nodes -1 to 2: expected numbers from 0 to 3"),
        ([0, 1, 2, 3], {"cell_sets": {"a": [[3]]}}, {}, "cell set 'a' has the elements 3 to 3"),
        ([0, 1, 2, 3], {"cell_data": {"m": [["x"]]}}, {"tags": "m"}, "'m': expected a whole number"),
        ([0, 1, 2, 3], {"cell_data": {"m": [[1.5]]}}, {"tags": "m"}, "'m': expected a whole number"),
        ([0, 1, 2, 3], {"cell_sets": {"a": [[0]]}}, {"groups": "a"}, "expected a list with some of 'a'"),
        ([0, 1, 2, 3], {"cell_sets": {"a": [[0]]}}, {"groups": []}, "expected the names of one"),
        ([0, 1, 2, 3], {}, {"groups": ["a"]}, "its elements have no groups: expected groups=None"),
    ],
)  # fmt: skip
def test_error_messages_of_numbers_and_groups(nodes, data, options, message):
    with pytest.raises(tawami.InputError, match=message):
        tawami.mesh(grid_of(), meshio.Mesh(SQUARE, [("quad", [nodes])], **data), **options)


def test_advice_about_groups_works():
    """The two messages about groups say what to write."""
    points, cells, tag = quads()
    sets = {"all": [np.arange(len(cells))], "sand": [np.flatnonzero(tag == SAND)]}
    mesh = made(points, "quad", cells, cell_sets=sets)
    with pytest.raises(tawami.InputError, match=r"with groups=\[...\] \(there are 'all', 'sand'\)"):
        tawami.mesh(grid_of(), mesh)
    assert tawami.mesh(grid_of(), mesh, groups=["all"]).volume.sum() == pytest.approx(1.7 * 1.1)
    del mesh.cell_sets["all"]
    with pytest.raises(tawami.InputError, match=r"groups=\['sand'\] leaves out the others"):
        tawami.mesh(grid_of(), mesh)
    assert tawami.mesh(grid_of(), mesh, groups=["sand"]).volume.sum() == pytest.approx(1.7 * 0.55)


@pytest.mark.slow
def test_time_for_many_elements():
    """50 000 triangles on 64 x 64 cells; `pytest -s` prints the time."""
    random = np.random.default_rng(0)
    points = random.uniform(-0.93, 0.93, (25000, 2))
    cells = Delaunay(points).simplices
    tag = np.where(points[cells].mean(axis=1)[:, 1] > 0.1, CLAY, SAND)
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(-1, -1), h=1 / 32, cells=(64, 64))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        begin = perf_counter()
        body = tawami.mesh(grid, made(points, "triangle", cells, tag), per_axis=2)
        seconds = perf_counter() - begin
    print(f"{len(cells)} triangles: {len(body.x)} particles in {seconds:.1f} s")
    exact = moments.of_polygons(points[cells])[:3]
    assert moments.of_particles(body)[:3] == pytest.approx(exact, rel=1e-11, abs=1e-11)
