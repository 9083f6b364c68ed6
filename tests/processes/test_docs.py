"""The documentation: complete, and correct as far as that can be checked without building it."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from pathlib import Path

import compatibility
import executed
import messages
import pages
import pytest
import sources

import tawami
from tawami.base import errors

DOCS = Path(pages.__file__).parent
PAGES = {str(p.relative_to(DOCS).with_suffix("")): p.read_text() for p in DOCS.rglob("*.md")}
GENERATED = {f"cases/{name}" for name in pages.CASES}
FENCE = re.compile(r"^(```+).*?^\1\n", flags=re.DOTALL | re.MULTILINE)


def prose(text):
    """Without its blocks of code and equations."""
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
        for page in re.findall(r"\{doc\}`([\w/]+)`", text):
            beside = f"{name.rpartition('/')[0]}/{page}".lstrip("/")
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
        "rust/basis.rs Basis::none",
    ],
)
def test_a_missing_file_or_symbol_is_named(reference):
    assert reference.split()[-1].split(".")[-1].split("::")[-1] in sources.missing(reference)


def test_every_equation_of_the_theory_is_beside_its_file():
    """Between two headings there is a file for the equations there."""
    for section in re.split(r"^##+ ", PAGES["theory"], flags=re.MULTILINE)[2:]:
        if ":label:" in section:
            assert sources.ROLE.search(section), section[:60]


def test_every_form_and_law_is_in_the_theory():
    named = {reference.split()[0] for reference in sources.ROLE.findall(PAGES["theory"])}
    forms = {f"forms/{path.name}" for path in (sources.ROOT / "forms").glob("[!_]*.py")}
    laws = {f"rust/material/{path.name}" for path in (sources.ROOT / "rust/material").glob("*.rs")}
    assert forms | laws - {"rust/material/friction.rs"} <= named


def test_every_public_name_is_in_the_api():
    api = PAGES["api"]
    named = set(re.findall(r"^\.\. auto(?:class|function|exception):: tawami\.(\w+)$", api, re.M))
    assert set(tawami.__all__) - named == set()
    assert named <= set(tawami.__all__)


def test_existing_names_are_found():
    assert pages.exists("tawami.scene.scene.Scene.solve")
    assert pages.exists("tawami.motion.stepping")
    assert not pages.exists("tawami.scene.scene.Scene.nothing")


def test_every_class_of_error_and_warning_has_a_message():
    collected = messages.collected()
    kinds = {message.kind for message in collected}
    bases = {"TawamiError", "TawamiWarning"}  # never raised themselves
    assert set(errors.__all__) - bases <= kinds
    table = pages._classes()
    assert all(f"`{kind}`" in table for kind in kinds - {"InvertedError"})
    listed = re.findall(r"^- `(\w+)`:", messages.listing(), flags=re.MULTILINE)
    assert len(listed) > 150
    assert set(listed) == kinds


def test_help_is_for_messages_that_exist():
    """Each heading is part of a message of the code, with dots for the values."""
    headings = re.findall(r"^### `(.+)`$", PAGES["messages"], flags=re.MULTILINE)
    assert len(headings) >= 25
    says = [re.sub(r"<.*?>", "...", message.says) for message in messages.collected()]
    says += [re.sub(r"\.\.\.(\S)", r"... \1", text) for text in says]
    for heading in headings:
        parts = [part.strip() for part in heading.split("...")]
        pattern = ".*?".join(re.escape(part) for part in parts)
        assert any(re.search(pattern, text) for text in says), heading


def test_messages_of_every_kind_are_found():
    """Raised by name, through a helper, as a warning, from Rust."""
    found = {(message.kind, message.says) for message in messages.collected()}
    for kind, says in (
        ("InputError", "edge <shown(name)>: expected 'left', 'right', 'bottom' or 'top'"),
        ("FormError", "field '<name>' is of kind '<kind>': expected one of <quoted(FIELD_UNITS)>"),
        ("InputError", "volume of particle <index> is <value> m2: expected a positive number"),
        ("InputError", "phi = <value>: expected a friction angle in degrees, 0 <= phi < 90"),
    ):
        assert (kind, says) in found


def test_code_of_a_page_is_run_and_must_raise_what_it_says():
    printed = executed.run_blocks([("", "x = 2"), ("", "print(x + 1)"), ("ValueError", "int('x')")])
    assert printed[1] == "3\n"
    assert printed[2].startswith("ValueError: invalid literal")
    with pytest.raises(executed.RunError, match="ZeroDivisionError"):
        executed.run_blocks([("", "1 / 0")])
    with pytest.raises(executed.RunError, match="nothing was raised"):
        executed.run_blocks([("ValueError", "1 + 1")])


def test_code_is_run_again_only_if_its_sources_changed(tmp_path):
    runs = []

    def work():
        runs.append(1)
        return "said"

    for mark in ("a", "a", "b"):
        assert executed.kept(tmp_path / "case", mark, work).text == "said"
    assert len(runs) == 2

    def fail():
        raise executed.RunError("no")

    with pytest.raises(executed.RunError):
        executed.kept(tmp_path / "case", "c", fail)
    executed.kept(tmp_path / "case", "c", work)  # a failure is not kept
    assert len(runs) == 3


def test_a_fingerprint_depends_on_its_files():
    one = executed.fingerprint(["forms/*.py"])
    assert one == executed.fingerprint(["forms/*.py"])
    assert one != executed.fingerprint(["forms/u*.py", "Cargo.lock"])
    assert one != executed.fingerprint(["forms/*.py"], "more")


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


@pytest.fixture(scope="module")
def tried():
    rows, laws = ("u_p", "u_epsv_finite"), ("linear_elastic", "mohr_coulomb", "NumpyLaw")
    return [
        compatibility.attempt(form, law, time)
        for form in rows for law in laws for time in compatibility.TIMES
    ]  # fmt: skip


def test_a_part_of_the_table_of_compatibility(tried):
    refused = {(cell.form, cell.law): cell.says for cell in tried if cell.error}
    assert set(refused) == {("u_p", "mohr_coulomb"), ("u_epsv_finite", "NumpyLaw")}
    assert {cell.error for cell in tried if cell.error} == {"InputError"}
    assert "depends on the mean stress" in refused["u_p", "mohr_coulomb"]
    assert "expected a law in Rust" in refused["u_epsv_finite", "NumpyLaw"]


def test_the_stress_of_a_compressed_block_is_the_closed_form(tried):
    """With free sides sigma_yy = E/(1 - nu^2) eps_yy; finite strain differs by 1 %."""
    exact = compatibility.E / (1 - compatibility.NU**2) * compatibility.PRESSED
    for cell in tried:
        if (cell.law, cell.time, cell.error) == ("linear_elastic", "static", ""):
            assert cell.numbers[0] == pytest.approx(exact, rel=0.03)


def test_the_table_shows_every_attempt(tried):
    text = compatibility.page(tried, {1: 1.0})
    assert text.count("| works |") + text.count("| works ") >= 6
    assert text.count("refused 1") == text.count("refused 2") == 2
    assert re.search(
        r"^12 were tried, 0 of them on 2 ranks .*; 8 work, 4 are refused", text, re.MULTILINE
    )


def test_ranks_that_differ_are_found():
    one = compatibility.Cell("u", "von_mises", "static", 1, numbers=(1.0, 2.0))
    two = compatibility.Cell("u", "von_mises", "static", 2, numbers=(1.0, 2.2))
    assert compatibility.difference([one, two]) == pytest.approx(0.1)
    with pytest.raises(AssertionError):
        compatibility.difference(
            [one, compatibility.Cell("u", "von_mises", "static", 2, "InputError", "no")]
        )


def test_the_matrix_of_the_readme_has_the_columns_of_make_matrix():
    script = (sources.ROOT / "tests" / "matrix.sh").read_text()
    (header,) = re.findall(r"echo '(\| Debian .*\|)'", script)
    assert header in (sources.ROOT / "README.md").read_text()
    assert "SUITES:-bookworm trixie sid}" in script


def test_make_matrix_names_what_is_missing():
    """Root, its tools, or a suite that it knows, whichever is missing first."""
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
