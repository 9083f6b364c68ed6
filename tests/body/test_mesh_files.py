"""Files of Gmsh, Abaqus and Kratos: groups, types of elements, error messages; nothing is printed."""

from __future__ import annotations

import contextlib

import meshio
import numpy as np
import pytest
from mpi4py import MPI

import tawami

GRID = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=0.5, cells=(6, 2))
#: Three squares in a row, each of two triangles, and the nodes of each.
NODES = [(x, y) for y in (0, 1) for x in (0, 1, 2, 3)]
TRIANGLES = [n for k in (0, 1, 2) for n in ([k, k + 1, k + 5], [k, k + 5, k + 4])]
QUADS = [[k, k + 1, k + 5, k + 4] for k in (0, 1, 2)]


def volumes(body):
    """Volume of each material; "" is the name if there are no names."""
    of = np.zeros(len(body.x), dtype=int) if body.material_of is None else body.material_of
    return {
        name: pytest.approx(body.volume[of == k].sum(), rel=1e-12)
        for k, name in enumerate(body.names or ("",))
    }


def gmsh_4(groups, names, *, binary=False, lines=()):
    """Version 4.1: a surface for each square, with these physical groups; curves with theirs."""
    size, kind, real = (np.dtype(t) for t in ("u8", "i4", "f8"))
    head = f"$MeshFormat\n4.1 {int(binary)} 8\n".encode()
    head += np.array([1], kind).tobytes() + b"\n" if binary else b""
    head += b"$EndMeshFormat\n$PhysicalNames\n%d\n" % len(names)
    head += b"".join(b'%d %d "%s"\n' % (d, n, name.encode()) for d, n, name in names)
    head += b"$EndPhysicalNames\n"
    entities = [(size, [0, len(lines), 3, 0])]
    for d, of in ((1, lines), (2, groups)):
        for tag, numbers in enumerate(of, 1):
            entities += [(kind, [tag]), (real, [0, 0, 0, 3, 1, 0]), (size, [len(numbers)])]
            entities += [(kind, numbers), (size, [d - 1]), (kind, [1] * (d - 1))]
    nodes = [(size, [1, 8, 1, 8]), (kind, [2, 1, 0]), (size, [8]), (size, range(1, 9))]
    nodes += [(real, [x, y, 0]) for x, y in NODES]
    elements = [(size, [3 + len(lines), 6 + len(lines), 1, 6 + len(lines)])]
    for tag in range(1, len(lines) + 1):
        elements += [(kind, [1, tag, 1]), (size, [1]), (size, [6 + tag, tag, tag + 1])]
    for k in range(3):
        elements += [(kind, [2, k + 1, 2]), (size, [2])]
        elements += [(size, [e + 1, *np.add(TRIANGLES[e], 1)]) for e in (2 * k, 2 * k + 1)]
    for name, parts in (("Entities", entities), ("Nodes", nodes), ("Elements", elements)):
        head += f"${name}\n".encode()
        for dtype, values in parts:
            array = np.array(list(values), dtype)
            head += array.tobytes() if binary else (" ".join(map(str, array)) + "\n").encode()
        head += b"\n" * binary + f"$End{name}\n".encode()
    return head


def gmsh_40(groups, names, lines=()):
    """Version 4.0 has other sections of nodes and elements."""
    head = gmsh_4(groups, names, lines=lines).decode().replace("4.1 0 8", "4.0 0 8")
    rows = ["$Nodes", "1 8", "1 2 0 8", *(f"{k} {x} {y} 0" for k, (x, y) in enumerate(NODES, 1))]
    rows += ["$EndNodes", "$Elements", f"{3 + len(lines)} {6 + len(lines)}"]
    rows += [
        row for k in range(1, len(lines) + 1) for row in (f"{k} 1 1 1", f"{6 + k} {k} {k + 1}")
    ]
    for k in range(3):
        rows += [f"{k + 1} 2 2 2"]
        rows += [
            f"{e + 1} {' '.join(str(n + 1) for n in TRIANGLES[e])}" for e in (2 * k, 2 * k + 1)
        ]
    return head[: head.index("$Nodes")] + "\n".join([*rows, "$EndElements", ""])


def gmsh_2(groups, names, **_):
    """Version 2.2: an element is listed for each of its physical groups."""
    lines = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$PhysicalNames", str(len(names))]
    lines += [f'{d} {n} "{name}"' for d, n, name in names]
    lines += ["$EndPhysicalNames", "$Nodes", "8"]
    lines += [f"{k} {x} {y} 0" for k, (x, y) in enumerate(NODES, 1)]
    rows = ["1 2 9 1 1 2"]
    for k, numbers in enumerate(groups):
        for number in numbers or [0]:
            for e in (2 * k, 2 * k + 1):
                rows += [f"2 2 {number} {k + 1} {' '.join(str(n + 1) for n in TRIANGLES[e])}"]
    rows = [f"{k} {row}" for k, row in enumerate(rows, 1)]
    return "\n".join([*lines, "$EndNodes", "$Elements", str(len(rows)), *rows, "$EndElements", ""])


NAMES = [(2, 1, "soil"), (2, 2, "clay"), (2, 3, "sand"), (1, 9, "clay")]
WRITERS = {
    "2.2": lambda *a, **o: gmsh_2(*a, **o).encode(),
    "4.0": lambda *a, **o: gmsh_40(*a, **o).encode(),
    "4.1": gmsh_4,
    "4.1 binary": lambda *a, **o: gmsh_4(*a, **o, binary=True),
}


@pytest.fixture(params=WRITERS)
def gmsh(request, tmp_path):
    """Write a file of Gmsh in each version; fill a body with it."""

    def body(of_surfaces, lines=(), **options):
        path = tmp_path / "body.msh"
        path.write_bytes(WRITERS[request.param](of_surfaces, NAMES, lines=lines))
        return tawami.mesh(GRID, path, **options)

    return body


@pytest.fixture(autouse=True)
def nothing_is_printed(capfd):
    yield
    assert capfd.readouterr() == ("", "")


def test_elements_in_several_physical_groups(gmsh):
    """All are soil, two squares are clay and one is sand."""
    groups = [[1, 2], [1, 2], [3, 1]]
    with pytest.raises(
        tawami.InputError, match=r"6 of its elements are in several physical groups"
    ):
        gmsh(groups)
    with pytest.raises(
        tawami.InputError, match=r"groups=\[...\] \(there are 'soil', 'clay', 'sand'\)"
    ):
        gmsh(groups)
    assert volumes(gmsh(groups, groups=["clay", "sand"])) == {"clay": 2.0, "sand": 1.0}
    assert gmsh(groups, groups=["sand", "clay"]).names == ("sand", "clay")
    assert volumes(gmsh(groups, groups=["soil"])) == {"soil": 3.0}
    assert volumes(gmsh(groups, groups=("sand",))) == {"sand": 1.0}
    with pytest.raises(
        tawami.InputError, match=r"expected a list with some of 'soil', 'clay', 'sand'"
    ):
        gmsh(groups, groups=["silt"])
    with pytest.raises(tawami.InputError, match=r"'soil' and 'clay': expected each in one"):
        gmsh(groups, groups=["soil", "clay"])


def test_groups_without_names_and_negative_numbers(gmsh):
    """A negative number means the opposite orientation; the group has the same name."""
    assert volumes(gmsh([[-2], [2], [-3]])) == {"clay": 2.0, "sand": 1.0}
    assert volumes(gmsh([[7], [-7, 5], [-3]], groups=["7", "sand"])) == {"7": 2.0, "sand": 1.0}


def test_physical_groups_of_curves(gmsh):
    """A curve and a surface may share a name; the groups of the body are those of the surfaces."""
    body = gmsh([[2], [2], [3]], lines=[[9], [-9]])
    assert body.names == ("clay", "sand")
    named = body.border.lengths["clay"]
    assert named in (1.0, 2.0)  # the file of version 2 has one line
    assert body.border.lengths == {"clay": named, "border": 8.0 - named}


def test_elements_without_a_group(gmsh):
    """Gmsh writes them with Mesh.SaveAll."""
    assert volumes(gmsh([[], [], []], lines=[[], [9]])) == {"": 3.0}
    assert volumes(gmsh([[2], [2], [3]], lines=[[], [9]])) == {"clay": 2.0, "sand": 1.0}
    with pytest.raises(
        tawami.InputError, match=r"2 of its elements, the first is 2, .* leaves out"
    ):
        gmsh([[2], [], [3]])
    assert volumes(gmsh([[2], [], [3]], groups=["clay", "sand"])) == {"clay": 1.0, "sand": 1.0}


def test_gmsh_4_by_meshio(tmp_path):
    """A mesh that the script reads has one group in its array, the others as sets."""
    path = tmp_path / "body.msh"
    path.write_bytes(gmsh_4([[1, 2], [1, 2], [3, 1]], NAMES[:3]))
    read = meshio.gmsh.read(path)
    with pytest.raises(tawami.InputError, match="in several physical groups"):
        tawami.mesh(GRID, read)
    assert volumes(tawami.mesh(GRID, read, groups=["clay", "sand"])) == {"clay": 2.0, "sand": 1.0}


def abaqus(kind, elements, more="", head="*Element, type={kind}, elset=all"):
    nodes = "".join(f"{10 * k + 10}, {x}., {y}.\n" for k, (x, y) in enumerate(NODES))
    rows = [f"{k}, " + ", ".join(str(10 * n + 10) for n in e) for k, e in enumerate(elements, 1)]
    rows[0] = rows[0].replace(", ", ",\n", 1)  # continued on the next line
    return "\n".join(
        ["*Heading", "** text", "*Node", nodes, head.format(kind=kind), *rows, more, ""]
    )


@pytest.mark.parametrize(
    "kind", ["CPE3", "cpe4", "CPE4R", "CPE4RH", "CPE4H", "CPS4", "S4R5", "STRI3"]
)
def test_abaqus(tmp_path, kind):
    """Sets: by name in *Element, by numbers, as a range, and of other sets."""
    quads = "4" in kind
    last = "3" if quads else "5, 6"
    first = "1, 2" if quads else "1, 4"
    path = tmp_path / "body.inp"
    more = f"*Elset, elset=Sand\n{last}\n*Elset, elset=part, generate\n{first}\n"
    more += "*ELSET, ELSET=Clay\nPART\n"
    path.write_text(abaqus(kind, QUADS if quads else TRIANGLES, more))
    body = tawami.mesh(GRID, path, groups=["Clay", "Sand"])
    assert volumes(body) == {"Clay": 2.0, "Sand": 1.0}
    with pytest.raises(
        tawami.InputError, match="in several cell sets.*there are 'all', 'Sand', 'part'"
    ):
        tawami.mesh(GRID, path)


def test_abaqus_with_one_set_of_two_types(tmp_path):
    """meshio takes the numbers of the last type for all."""
    path = tmp_path / "body.inp"
    more = "*Element, type=CPE3, elset=ALL\n8, 30, 40, 80\n*Element, type=T2D2\n9, 10, 20\n"
    more += "*Element, type=CPE3, elset=other\n7, 30, 80, 70\n*Solid section, elset=all\n1.\n"
    path.write_text(abaqus("CPE4", QUADS[:2], more))
    assert volumes(tawami.mesh(GRID, path)) == {"all": 2.5, "other": 0.5}


def test_node_sets_of_abaqus(tmp_path):
    """A side is in the smallest set that has both of its nodes."""
    path = tmp_path / "body.inp"
    more = "*Nset, nset=base, generate\n10, 40, 10\n*NSET, NSET=Wall\n10, 50\n"
    path.write_text(abaqus("CPE4", QUADS, more))
    lengths = tawami.mesh(GRID, path).border.lengths
    assert lengths == {"base": 3.0, "border": 4.0, "Wall": 1.0}
    path.write_text(abaqus("CPE4", QUADS, more + "*Nset, nset=all\nbase, wall, 60, 70, 80\n"))
    assert tawami.mesh(GRID, path).border.lengths == {"base": 3.0, "all": 4.0, "Wall": 1.0}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (abaqus("C3D8", QUADS), "line 13: element type 'C3D8': expected plane elements, such as CPE3"),
        (abaqus("CPE8", QUADS), "element 1 of type CPE8 has 4 nodes: expected 8"),
        (abaqus("CPE4", [[0, 1, 5, 99]]), "element 1 has node 1000, which is not in the file"),
        (abaqus("CPE4", [*QUADS, "xyz"][:3], "*Node\n10, 7, 7\n"), "node 10 is listed twice"),
        (abaqus("CPE4", QUADS, "*Element, type=CPE4\n1, 10, 20, 30, 40\n"), "element 1 is listed twice"),
        (abaqus("CPE4", QUADS, "*Ngen\n1, 5\n"), r"\*NGEN with nodes or elements that this file does"),
        (abaqus("CPE4", QUADS, "*Instance\n1., 0.\n"), r"\*INSTANCE moves its part"),
        (abaqus("CPE4", QUADS, "*Node\n11, a, b\n"), "'a b': expected numbers"),
        (abaqus("CPE4", QUADS, "*Node\n11, 1, 2, 3, 4\n"), "'11 1 2 3 4': expected a node, its number"),
        ("", "holds no elements: expected triangles or quadrilaterals"),
        ("*Heading\n", "holds no elements: expected triangles or quadrilaterals"),
    ],
)  # fmt: skip
def test_error_messages_of_abaqus(tmp_path, text, message):
    path = tmp_path / "body.inp"
    path.write_text(text)
    with pytest.raises(tawami.InputError, match=message):
        tawami.mesh(GRID, path)


def kratos(elements, parts="", name="UPwSmallStrainElement2D{n}N", properties=(0, 0, 1)):
    name = name.format(n=len(elements[0]))
    lines = ["Begin ModelPartData", "// nothing", "End ModelPartData", "Begin Properties 0",
             "DENSITY 2000.0", "End Properties", "Begin Nodes"]  # fmt: skip
    lines += [f"  {k + 5} {x}.0 {y}.0 0.0 // a node" for k, (x, y) in enumerate(NODES)]
    lines += ["End Nodes", f"Begin Elements {name}"]
    lines += [
        f"{k + 1} {properties[k * 3 // len(elements)]} {' '.join(str(n + 5) for n in e)}"
        for k, e in enumerate(elements)
    ]
    lines += ["End Elements", "Begin Conditions LineCondition2D2N", "1 0 5 6", "End Conditions"]
    return "\n".join([*lines, parts, ""])


PARTS = """
Begin SubModelPart soil
  Begin SubModelPartNodes
    5
  End SubModelPartNodes
  Begin SubModelPartElements
  End SubModelPartElements
  Begin SubModelPart clay
    Begin SubModelPartElements
      1
      2
    End SubModelPartElements
  End SubModelPart
  Begin SubModelPart sand
    Begin SubModelPartElements
      3
    End SubModelPartElements
  End SubModelPart
End SubModelPart
"""


@pytest.mark.parametrize("elements", [QUADS, TRIANGLES])
@pytest.mark.parametrize(
    "name", ["UPwSmallStrainElement2D{n}N", "Element2D{n}N", "UpdatedLagrangian2D", "Element2D"]
)
def test_kratos(tmp_path, elements, name):
    path = tmp_path / "body.mdpa"
    path.write_text(kratos(elements, name=name))
    assert volumes(tawami.mesh(GRID, path)) == {"0": 2.0, "1": 1.0}  # properties
    path.write_text(kratos(elements, name=name, properties=(4, 4, 4)))
    assert volumes(tawami.mesh(GRID, path)) == {"": 3.0}
    if elements is QUADS:
        path.write_text(kratos(elements, PARTS, name=name))
        with pytest.raises(tawami.InputError, match="in 'soil' and 'clay': expected each in one"):
            tawami.mesh(GRID, path)
        body = tawami.mesh(GRID, path, groups=["clay", "sand"])
        assert volumes(body) == {"clay": 2.0, "sand": 1.0}


def test_conditions_of_kratos(tmp_path):
    path = tmp_path / "body.mdpa"
    part = "Begin SubModelPart {0}\nBegin SubModelPartConditions\n{1}\nEnd SubModelPartConditions\n"
    part += "End SubModelPart\n"
    more = "Begin Conditions LineLoadCondition2D3N\n7 0 6 7 8\nEnd Conditions\n"
    path.write_text(kratos(QUADS, more + part.format("load", 1) + part.format("base", 7)))
    body = tawami.mesh(GRID, path)
    assert body.names == ("0", "1")
    assert body.border.lengths == {"load": 1.0, "base": 1.0, "border": 6.0}
    path.write_text(kratos(QUADS, more.replace("6 7 8", "6 77")))
    with pytest.raises(tawami.InputError, match="line 7 has node 77, which is not in the file"):
        tawami.mesh(GRID, path)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (kratos(QUADS, name="SmallDisplacementElement3D4N"), "line 18: element 1 is a Small.* with 4"),
        (kratos([[0, 1, 5, 4, 2]]), "element 1 is a .* with 5 nodes: expected plane elements with 3, 4"),
        (kratos([[0, 1, 50]]), "element 1 has node 55, which is not in the file"),
        (kratos(QUADS, "Begin SubModelPart a\n"), "the file ends inside of SubModelPart a"),
        (kratos(QUADS, "End Nodes\n"), "End Nodes: expected the end of the block that began last"),
    ],
)  # fmt: skip
def test_error_messages_of_kratos(tmp_path, text, message):
    path = tmp_path / "body.mdpa"
    path.write_text(text)
    with pytest.raises(tawami.InputError, match=message):
        tawami.mesh(GRID, path)


def test_what_meshio_prints_is_in_the_message_or_a_warning(tmp_path):
    path = tmp_path / "body.msh"
    text = gmsh_2([[1], [1], [1]], NAMES)
    path.write_text(text.replace("$EndElements", ""))
    with pytest.warns(
        tawami.GeometryWarning, match="meshio reads 'body.msh' with a warning: .*not cl"
    ):
        tawami.mesh(GRID, path)
    path.write_text(text.replace("2.2 0 8", "1.0 0 8"))
    with pytest.raises(tawami.InputError, match=r"body.msh' cannot be read \(.*Need mesh format"):
        tawami.mesh(GRID, path)
    path.write_text(gmsh_4([[1], [1], [1]], NAMES).decode().replace("2 1 0\n8\n", "2 1 1\n8\n"))
    with pytest.raises(tawami.InputError, match="cannot be read .parametric nodes not implemented"):
        tawami.mesh(GRID, path)


def test_files_that_are_cut_off(tmp_path):
    """Every error is one message, wherever the file ends."""
    path = tmp_path / "body.msh"
    for content in (gmsh_2([[1], [2], [3]], NAMES).encode(), gmsh_4([[1], [2], [3]], NAMES),
                    gmsh_4([[1], [2], [3]], NAMES, binary=True)):  # fmt: skip
        for end in range(20, len(content) - 15, 40):
            path.write_bytes(content[:end])
            with pytest.raises(tawami.InputError, match="cannot be read"):
                tawami.mesh(GRID, path)


@pytest.mark.parametrize("seed", range(3))
def test_lines_that_are_damaged(tmp_path, seed):
    """A word is removed or replaced: the body is made, or the error is one message."""
    random = np.random.default_rng(seed)
    for name, text in (("a.inp", abaqus("CPE4", QUADS, "*Elset, elset=a, generate\n1, 3\n")),
                       ("a.mdpa", kratos(QUADS, PARTS))):  # fmt: skip
        words = text.split(" ")
        for _ in range(60):
            damaged = list(words)
            damaged[random.integers(len(words))] = random.choice(["", "x", "0", "-1,", "End Nodes"])
            (tmp_path / name).write_text(" ".join(damaged))
            with contextlib.suppress(tawami.InputError):
                tawami.mesh(GRID, tmp_path / name, groups=None)


def test_partitioned_files(tmp_path):
    path = tmp_path / "body.msh"
    content = gmsh_4([[1], [1], [1]], NAMES)
    path.write_bytes(content + b"$PartitionedEntities\n0\n$EndPartitionedEntities\n")
    with pytest.raises(tawami.InputError, match="is partitioned: expected a mesh in one part"):
        tawami.mesh(GRID, path)
