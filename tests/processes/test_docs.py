"""The documentation, as far as it can be checked without building it."""

from __future__ import annotations

import importlib
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import browser
import compatibility
import executed
import messages
import notebooks
import numpy as np
import pages
import pytest
import sources
import thumbnails
from PIL import Image

import tawami
from tawami.base import errors
from tawami.form.files import shipped
from tawami.form.form import Form

DOCS = Path(pages.__file__).parent
PAGES = {str(p.relative_to(DOCS).with_suffix("")): p.read_text() for p in DOCS.rglob("*.md")}
GENERATED = {f"cases/{name}" for name in pages.CASES}
FENCE = re.compile(r"^(```+).*?^\1\n", flags=re.DOTALL | re.MULTILINE)


def prose(text):
    """Text without its blocks of code and equations."""
    return FENCE.sub("", text)


def test_every_page_has_one_title_and_a_place():
    placed = {"index"}
    for name, text in PAGES.items():
        for tree in re.findall(r"```\{toctree\}\n(.*?)```", text, flags=re.DOTALL):
            folder = name.rpartition("/")[0]
            entries = [line for line in tree.splitlines() if line and not line.startswith(":")]
            placed |= {f"{folder}/{entry}".lstrip("/") for entry in entries}
        if "{include}" not in text:
            assert len(re.findall(r"^# ", prose(text), flags=re.MULTILINE)) == 1, name
    assert placed == set(PAGES) | GENERATED


def test_links_have_targets():
    labels = [x for t in PAGES.values() for x in re.findall(r"^:label: (\w+)$", t, re.MULTILINE)]
    assert len(labels) == len(set(labels)) > 30
    for name, text in PAGES.items():
        for label in re.findall(r"\{eq\}`(\w+)`", text):
            assert label in labels, (name, label)
        for page in re.findall(r"\{doc\}`(?:[^`]*<)?([\w/.]+)>?`", text):
            beside = os.path.normpath(Path(name).parent / page)
            assert beside in set(PAGES) | GENERATED, (name, page)
        for target in re.findall(r"^```\{(?:literal)?include\} (\S+)$", text, re.MULTILINE):
            assert (DOCS / target).is_file(), (name, target)
        for link in re.findall(r"(?<!!)\[[^\]]*\]\(([^)]+)\)", prose(text)):
            assert link.startswith("https://"), (name, link)
        for part in re.findall(r"\{\{(.+?)\}\}", text):
            assert part in pages.GENERATED, (name, part)
        pages._check_links(name, text)


def test_a_malformed_link_is_rejected():
    with pytest.raises(executed.RunError, match="not well-formed"):
        pages._check_links("page", "see [it](https://nowhere)")


def test_pages_that_would_load_something_from_the_web_or_show_paths(tmp_path):
    head = '<link rel="stylesheet" href="{0}"><script defer src="{0}"></script><a href="https://x.org">x</a>'
    (tmp_path / "local.html").write_text(head.format("_static/mathjax/tex-svg.js"))
    assert pages.problems(tmp_path) == []
    (tmp_path / "remote.html").write_text(head.format("//cdn.net/mathjax.js"))
    said = "remote.html: //cdn.net/mathjax.js would be loaded from the web"
    assert pages.problems(tmp_path) == [said] * 2
    (tmp_path / "remote.html").write_text(f"File {sources.ROOT}/script.py")
    assert "of this machine" in pages.problems(tmp_path)[0]


def test_files_and_symbols_that_pages_name_exist():
    found = [(name, r) for name, text in PAGES.items() for r in sources.ROLE.findall(text)]
    assert len(found) > 60
    assert {name: sources.missing(r) for name, r in found if sources.missing(r)} == {}


@pytest.mark.parametrize(
    "reference",
    [
        "forms/none.py",
        "forms/u.py none",
        "python/tawami/solve/newton.py Newton.none",
        "rust/grid/basis.rs Basis::none",
    ],
)
def test_references_to_missing_files_and_symbols(reference):
    assert reference.split()[-1].split(".")[-1].split("::")[-1] in sources.missing(reference)


def test_references_become_links(tmp_path):
    """To the public repository if pyproject.toml names one, else to the file of this checkout."""
    project = tmp_path / "pyproject.toml"
    project.write_text('[project]\nname = "x"\n')
    assert sources.repository(project) == ""
    project.write_text(
        '[project]\nname = "x"\n[project.urls]\nRepository = "https://host.org/x/"\n'
    )
    base = sources.repository(project)
    assert (
        sources.address("forms/u.py residual", base, DOCS)
        == "https://host.org/x/blob/HEAD/forms/u.py"
    )
    link = sources.address("forms/u.py residual", "", DOCS)
    assert (DOCS / link).resolve() == (sources.ROOT / "forms" / "u.py").resolve()


def test_every_section_of_the_theory_names_its_files():
    """Each section with equations has a reference to a file."""
    for section in re.split(r"^##+ ", PAGES["theory"], flags=re.MULTILINE)[2:]:
        if ":label:" in section:
            assert sources.ROLE.search(section), section[:60]


def test_every_form_and_law_is_in_the_theory():
    named = {reference.split()[0] for reference in sources.ROLE.findall(PAGES["theory"])}
    forms = {f"forms/{path.name}" for path in (sources.ROOT / "forms").glob("[!_]*.py")}
    folder = sources.ROOT / "rust" / "law"
    laws = {f"rust/law/{p.name}" for p in folder.glob("*.rs") if "impl Law for" in p.read_text()}
    assert len(laws) >= 5
    assert forms | laws <= named


def test_every_public_name_is_on_one_page_of_the_api():
    documented = [
        name
        for page, text in PAGES.items() if page.startswith("api/")
        for name in pages.documented(text)
    ]  # fmt: skip
    assert len(documented) == len(set(documented))
    assert {name for name in documented if "." not in name} == set(tawami.__all__)


def test_names_in_pages_exist():
    """Names of the API, and imports in the code of pages."""
    for name, text in PAGES.items():
        named = re.findall(r"^\.\. auto\w+:: (\S+)$", text, re.MULTILINE)
        for module, imported in re.findall(r"^from (tawami\S*) import (.+)$", text, re.MULTILINE):
            named += [f"{module}.{part.split()[0]}" for part in imported.split(",")]
        assert [dotted for dotted in named if not pages.exists(dotted)] == [], name
    assert not pages.exists("tawami.scene.scene.Scene.nothing")


def test_every_class_of_error_and_warning_has_a_message():
    collected = messages.collected()
    kinds = {message.kind for message in collected}
    bases = {"TawamiError", "TawamiWarning"}  # they are never raised
    assert set(errors.__all__) - bases <= kinds
    table = pages._classes()
    assert all(f"`{kind}`" in table for kind in kinds - {"InvertedError"})
    listed = re.findall(r"^- `(\w+)`:", messages.listing(), flags=re.MULTILINE)
    assert len(listed) > 150
    assert set(listed) == kinds


def test_help_is_for_messages_that_exist():
    """Each heading is a part of a message of the code, with dots for expressions."""
    headings = re.findall(r"^### `(.+)`$", PAGES["messages"], flags=re.MULTILINE)
    assert len(headings) >= 25
    says = [re.sub(r"<.*?>", "...", message.says) for message in messages.collected()]
    says += [re.sub(r"\.\.\.(\S)", r"... \1", text) for text in says]
    for heading in headings:
        parts = [part.strip() for part in heading.split("...")]
        pattern = ".*?".join(re.escape(part) for part in parts)
        assert any(re.search(pattern, text) for text in says), heading


def test_messages_are_collected():
    """Examples of errors raised directly and by a helper, and of errors of Rust."""
    found = {(message.kind, message.says) for message in messages.collected()}
    for kind, says in (
        ("InputError", "edge <shown(name)>: expected 'left', 'right', 'bottom' or 'top'<hint>"),
        (
            "FormError",
            "test function <shown(test)>: expected a name, as vector('w') or scalar('q')",
        ),
        ("InputError", "volume of particle <index> is <value> m2: expected a positive number"),
        ("InputError", "phi = <value>: expected a friction angle in degrees, 0 <= phi < 90"),
    ):
        assert (kind, says) in found


def built_page(folder, *tags, raised=()):
    """Problems of a page with a cell that has tags and raised errors."""
    classes = " ".join(f"tag_{tag}" for tag in tags)
    output = '<div class="output traceback highlight-text"><pre><span></span>{}: no</pre></div>'
    cell = f'<div class="cell {classes} container">{"".join(map(output.format, raised))}</div>'
    (folder / "page.html").write_text(f"<article>{cell}<p>text</p></article>")
    return notebooks.problems(folder)


def test_code_of_a_page_must_raise_the_expected_error(tmp_path):
    assert built_page(tmp_path) == []
    expected = ("raises-exception", "ValueError")
    assert built_page(tmp_path, *expected, raised=["ValueError"]) == []
    (said,) = built_page(tmp_path, *expected, raised=["TypeError"])
    assert said.startswith("page.html: a cell raised TypeError")
    (said,) = built_page(tmp_path, *expected)
    assert said.startswith("page.html: a cell raised nothing")
    assert built_page(tmp_path, "raises-exception", raised=["ValueError"])


def test_every_page_with_code_is_a_notebook():
    for name, text in PAGES.items():
        assert ("{code-cell}" in text) == text.startswith("---\nfile_format: mystnb\n"), name
        for tags in re.findall(r"^:tags: \[(.*)\]$", text, flags=re.MULTILINE):
            assert re.fullmatch(r"raises-exception, \w+Error", tags), (name, tags)


@pytest.mark.slow
@pytest.mark.parametrize("name", pages.TUTORIALS)
def test_tutorials_can_be_downloaded_as_notebooks(name):
    """Text and code only, which imports nothing of the repository but the package."""
    nbformat = importlib.import_module("nbformat")
    notebook = nbformat.reads(notebooks.download(PAGES[name]), as_version=4)
    code = [cell.source for cell in notebook.cells if cell.cell_type == "code"]
    text = "\n".join(cell.source for cell in notebook.cells if cell.cell_type == "markdown")
    assert len(code) >= 3
    assert not re.search(r"\{\w+\}`|eval-rst", text)
    imported = set(re.findall(r"^(?:import|from) (\w+)", "\n".join(code), flags=re.MULTILINE))
    assert imported <= sys.stdlib_module_names | {
        "tawami",
        "numpy",
        "matplotlib",
        "mpi4py",
        "scipy",
        "ufl",
    }
    assert any("plot" in source for source in code)
    assert any("print(" in source for source in code)
    assert notebooks.download(PAGES[name]) == notebooks.download(PAGES[name])


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in PAGES if "{code-cell}" in PAGES[name]])
def test_code_of_pages_runs_anywhere(name, tmp_path, monkeypatch):
    """In a folder outside the repository, that of tutorials with the package alone."""
    nbclient = importlib.import_module("nbclient")
    nbformat = importlib.import_module("nbformat")
    folders = [sources.ROOT / "python"] + [sources.ROOT] * (name not in pages.TUTORIALS)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(map(str, folders)))
    monkeypatch.setenv("MPLBACKEND", "module://matplotlib_inline.backend_inline")
    notebook = nbformat.reads(notebooks.download(PAGES[name]), as_version=4)
    folder = {"metadata": {"path": str(tmp_path)}}
    nbclient.NotebookClient(notebook, timeout=300, resources=folder).execute()
    for cell in notebook.cells:
        raised = [o.ename for o in cell.get("outputs", []) if o.output_type == "error"]
        assert raised == [tag for tag in cell.metadata.get("tags", []) if tag.endswith("Error")]
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    drawn = any("image/png" in output.get("data", {}) for output in outputs)
    assert drawn or name not in pages.TUTORIALS


@pytest.mark.parametrize("name", pages.CASES)
def test_docstrings_of_cases_become_text(name):
    folder = sources.ROOT / "cases" / pages.CASES[name][1] / name
    file = folder / "__main__.py" if folder.is_dir() else folder.with_suffix(".py")
    shown = pages.markdown(pages._docstring(file))
    assert shown.count("````") % 2 == 0
    assert not re.match("`| ", shown)


def test_a_docstring_as_markdown():
    text = (
        "A *beam*, `E_1`\nof rubber.\n\n    -->  P\n\n      2 m\n\npython -m cases.x\npython -m y"
    )
    assert pages.markdown(text) == (
        "A \\*beam\\*, `E_1` of rubber\\.\n\n````text\n-->  P\n\n  2 m\n````\n\n"
        "````text\npython -m cases.x\npython -m y\n````"
    )


def test_thumbnails(tmp_path):
    """README's are in the repository, small, and a thumbnail is cut from the part of a figure."""
    assert set(thumbnails.README) <= set(thumbnails.PARTS) <= set(pages.CASES)
    files = [DOCS / "pictures" / "thumbnails" / f"{name}.png" for name in thumbnails.README]
    assert len(files) == 8
    assert sum(file.stat().st_size for file in files) < 400_000
    figure, part = thumbnails.PARTS["cut_cells"]
    whole = Image.new("RGB", (1000, 600), "white")
    whole.paste("red", (100, 100, 400, 500))
    whole.paste("blue", (600, 100, 900, 500))
    whole.save(tmp_path / figure)
    thumbnails.draw("cut_cells", tmp_path, tmp_path / "small.png")
    with Image.open(tmp_path / "small.png") as small:
        assert small.size == thumbnails.SIZE
        colours = {colour for _, colour in small.convert("RGB").getcolors()}
    assert part == (0.0, 0.0, 0.5, 1.0)
    assert (255, 0, 0) in colours
    assert (0, 0, 255) not in colours


def test_a_run_is_repeated_only_if_its_sources_changed(tmp_path):
    runs = []

    def work():
        runs.append(1)
        return "said"

    for mark in ("a", "a", "b"):
        assert executed.cached(tmp_path / "case", mark, work).text == "said"
    assert len(runs) == 2

    def fail():
        raise executed.RunError("no")

    with pytest.raises(executed.RunError):
        executed.cached(tmp_path / "case", "c", fail)
    executed.cached(tmp_path / "case", "c", work)  # a failure is not recorded
    assert len(runs) == 3


def test_a_fingerprint_depends_on_its_files():
    one = executed.fingerprint(["forms/*.py"])
    assert one == executed.fingerprint(["forms/*.py"])
    assert one != executed.fingerprint(["forms/u*.py", "Cargo.lock"])
    assert one != executed.fingerprint(["forms/*.py"], "more")


def test_a_fingerprint_depends_on_code_only(tmp_path, monkeypatch):
    """Not on comments, docstrings and layout of Python files."""
    monkeypatch.setattr(executed, "ROOT", tmp_path)
    marks = {}
    for text in (
        'def f():\n    """One."""\n    return 1',
        "def f():\n    'Two'\n    return (1)  # one",
    ):
        (tmp_path / "f.py").write_text(text)
        (tmp_path / "f.rs").write_text("fn f() {}")
        marks[text] = executed.fingerprint(["f.*"])
    assert len(set(marks.values())) == 1
    (tmp_path / "f.py").write_text("def f():\n    return 2")
    assert executed.fingerprint(["f.*"]) not in marks.values()


def test_every_case_is_a_page_and_can_be_run():
    for name, (_, room, beside) in pages.CASES.items():
        folder = sources.ROOT / "cases" / room / name
        files = [folder / "__main__.py", *(folder / f"{module}.py" for module in beside)]
        files = files if folder.is_dir() else [folder.with_suffix(".py")]
        assert all(pages._docstring(file) for file in files)
    rooms = (sources.ROOT / "cases" / room for room in ("verification", "showcase", "costs"))
    there = {
        path.stem for room in rooms for path in room.glob("[!_]*") if path.suffix in ("", ".py")
    }
    assert there == set(pages.CASES) | {"bench", "trade"}


def test_broken_links_are_found(tmp_path):
    page, other = tmp_path / "page.html", tmp_path / "other.html"
    page.touch()
    other.touch()
    targets = ["https://x.org/y", page.as_uri(), f"{other.as_uri()}#there"]
    names = {page: {"here"}, other: {"there"}}
    assert browser.broken({page: targets}, names) == []
    targets += [f"{other.as_uri()}#nowhere", (tmp_path / "none.html").as_uri()]
    said = [text for _, text in browser.broken({page: targets}, names)]
    assert said == [
        f"links to {tmp_path}/none.html, which does not exist",
        "links to other.html#nowhere, and the page has no such place",
    ]


@pytest.mark.slow
def test_one_page_is_built_and_opened_in_a_browser(tmp_path):
    """A page is built without problems; those of a page with mistakes are found."""
    words = [sys.executable, str(DOCS), "--page", "start"]
    built = subprocess.run(words, cwd=sources.ROOT, capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stderr
    wide = '<main><p style="width: 5000px">long</p><a href="none.html">x</a></main>'
    (tmp_path / "page.html").write_text(f"{wide}<script>nothing()</script>")
    said = browser.problems(tmp_path)
    assert len(said) == 5
    assert sum("is wider than" in text for text in said) == 3
    assert "nothing is not defined" in said[0]
    assert "none.html, which does not exist" in said[-1]


@pytest.fixture(scope="module")
def tried():
    rows, laws = (
        ("u_p", "u_epsv_finite"),
        ("linear_elastic", "mohr_coulomb", "neo_hookean", "NumpyLaw"),
    )
    return [
        compatibility.attempt(form, law, time)
        for form in rows for law in laws for time in compatibility.TIMES
    ]  # fmt: skip


def test_every_shipped_form_is_tried_with_its_data():
    tried = {options["form"] for options in compatibility.FORMS.values()}
    assert tried == set(shipped())
    for name in shipped():
        assert set(Form.load(name).data) <= set(compatibility.DATA), name


def test_combinations_that_are_rejected(tried):
    rejected = {(cell.form, cell.law): cell.says for cell in tried if cell.error}
    assert set(rejected) == {("u_p", "neo_hookean")}
    assert {cell.error for cell in tried if cell.error} == {"InputError"}
    assert "exists at finite strain only" in rejected["u_p", "neo_hookean"]


def test_stress_of_a_compressed_block_of_a_linear_law(tried):
    """With free sides sigma_yy = E/(1 - nu^2) eps_yy; finite strain differs by 1 %."""
    exact = compatibility.E / (1 - compatibility.NU**2) * compatibility.PRESSED
    for cell in tried:
        if (cell.law, cell.time, cell.error) == ("linear_elastic", "static", ""):
            assert cell.numbers[0] == pytest.approx(exact, rel=0.03)


def test_a_compressed_cylinder_of_the_table():
    """With a free side the axial stress is E times the strain, on the area pi r^2."""
    exact = np.pi * compatibility.E * compatibility.PRESSED
    pressed = compatibility.attempt("u_epsv, axisymmetric", "linear_elastic", "static")
    np.testing.assert_allclose(pressed.numbers[:2], [exact, -exact], rtol=1e-4)
    falling = compatibility.attempt("u_epsv, alpha(x, y)", "linear_elastic", "dynamic")
    assert falling.error == ""


def test_conditions_on_the_border_of_the_table():
    """Weight on an obstacle, and on patches of an axisymmetric body."""
    weight = -compatibility.RHO * compatibility.G
    cells = [
        compatibility.attempt("u", "obstacle", "border"),
        compatibility.attempt("u_epsv, axisymmetric", "support on patches", "border"),
    ]
    assert [cell.error for cell in cells] == ["", ""]
    assert cells[0].numbers[0] == pytest.approx(weight, rel=1e-3)
    assert cells[1].numbers[0] == pytest.approx(np.pi * weight, rel=1e-3)
    assert "`obstacle` |" in compatibility.page(cells[:1], {1: 1.0})


def test_the_table_shows_the_results(tried):
    text = compatibility.page(tried, {1: 1.0})
    assert text.count("| works |") + text.count("| works ") >= 7
    assert text.count("rejected 1") == 2
    assert text.count("rejected 2") == 0
    assert re.search(
        r"^16 combinations were run, 0 of them on 2 ranks .*: 14 work, 2 are rejected",
        text,
        re.MULTILINE,
    )


def test_different_results_on_several_ranks_are_an_error():
    one = compatibility.Cell("u", "von_mises", "static", 1, numbers=(1.0, 2.0))
    two = compatibility.Cell("u", "von_mises", "static", 2, numbers=(1.0, 2.2))
    assert compatibility.difference([one, two]) == pytest.approx(0.1)
    with pytest.raises(AssertionError):
        compatibility.difference(
            [one, compatibility.Cell("u", "von_mises", "static", 2, "InputError", "no")]
        )


def test_the_matrix_of_the_documentation_has_the_columns_of_make_matrix():
    script = (sources.ROOT / "tests" / "matrix.sh").read_text()
    (header,) = re.findall(r"echo '(\| Debian .*\|)'", script)
    assert header in (sources.ROOT / "python/docs/install.md").read_text()
    assert "SUITES:-bookworm trixie sid}" in script


def test_error_messages_of_make_matrix():
    """The first of: root is missing, a tool is missing, the suite is unknown."""
    script = sources.ROOT / "tests" / "matrix.sh"
    run = subprocess.run(
        [script], env=os.environ | {"SUITES": "buster"}, capture_output=True, text=True, check=False
    )
    said = run.stderr.strip()
    assert (run.returncode, run.stdout, said.count("\n")) == (1, "", 0)
    if os.geteuid() != 0:
        assert "root is needed" in said
    elif not all(map(shutil.which, ("debootstrap", "unshare", "git"))):
        assert "apt-get install debootstrap" in said
    else:
        assert said == "matrix: SUITES holds 'buster': expected bookworm, trixie or sid"
