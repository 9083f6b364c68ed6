"""The programs of the cases: names in the documentation, help, arguments, and what cases import."""

from __future__ import annotations

import ast
import importlib
import importlib.util
import re
from pathlib import Path

import pytest

from cases.common.program import Program, numbers
from cases.common.table import as_csv, as_markdown, as_text

ROOT = Path(__file__).parents[2]
FILES = sorted((ROOT / "cases").rglob("*.py"))
CASES = [file for file in FILES if "common" not in file.parts]


def has(file: Path, pattern: str) -> bool:
    return re.search(pattern, file.read_text(), re.MULTILINE) is not None


PROGRAMS = [file for file in CASES if has(file, "^PROGRAM = ")]


def module_of(file: Path) -> str:
    parts = file.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts)


def test_every_command_that_a_text_names_exists():
    texts = [ROOT / "Makefile", *ROOT.glob("*.md"), *ROOT.glob("python/docs/**/*.md")]
    texts += [*FILES, *ROOT.glob("python/tawami/**/*.py")]
    named = {
        name.rstrip(".")
        for path in texts
        if path.name != "CHANGELOG.md"
        for name in re.findall(r"-m\s+(cases\.[\w.]+)", path.read_text())
    } - {"cases.NAME"}
    assert len(named) > 15
    for name in named:
        assert importlib.util.find_spec(name) is not None, name


@pytest.mark.parametrize("file", PROGRAMS, ids=module_of)
def test_help(file, capsys):
    module = importlib.import_module(module_of(file))
    with pytest.raises(SystemExit) as end:
        module.PROGRAM.start(["--help"])
    assert end.value.code == 0
    name = module_of(file).removesuffix(".__main__")
    assert f"python -m {name} " in capsys.readouterr().out


def test_every_case_is_a_program():
    others = {
        "fem.py",
        "timed.py",
        "measure.py",
        "overheads.py",
        "cantilever.py",
    }  # finite elements, children, a name
    runs = {file for file in CASES if has(file, "^if __name__ ==") and file.name not in others}
    assert runs == set(PROGRAMS)


def test_cases_import_public_names_of_the_package():
    """`tawami` itself, or rooms that are made for it; what costs and extremes measure is internal."""
    allowed = re.compile(r"tawami(\.(base|fem|form|picture|results|study)(\.[a-z]\w*)?)?$")
    for file in FILES:
        if file.is_relative_to(ROOT / "cases" / "costs"):
            continue
        for node in ast.walk(ast.parse(file.read_text())):
            if isinstance(node, ast.ImportFrom) and str(node.module).startswith("tawami"):
                assert allowed.match(str(node.module)), (file, node.module)
                assert not any(alias.name.startswith("_") for alias in node.names), file


def test_a_program_creates_its_folder_and_writes_whole_files(tmp_path, capsys):
    program = Program("cases.room.name", "What it does.")
    program.option("--cells", type=numbers(int, lambda n: n > 1, "numbers above 1"), default="2,4")
    options = program.start(["--results", str(tmp_path / "new")])
    assert options.cells == [2, 4]
    program.write("a.txt", "text")
    program.list_results()
    printed = capsys.readouterr().out
    assert "tawami" in printed
    assert f"Results in {tmp_path / 'new'}:\n  {tmp_path / 'new' / 'a.txt'}\n" in printed
    assert [path.name for path in (tmp_path / "new").iterdir()] == ["a.txt"]
    for wrong in ("1,2", "", "two"):
        with pytest.raises(SystemExit):
            program.start(["--cells", wrong])
        assert f"--cells: {wrong}: expected numbers above 1" in capsys.readouterr().err


def test_tables():
    class Row:
        name, number, blank, count = "a", 1.23456789, None, 1234567

    columns = ("name", "number", "blank", "count")
    assert as_text([Row], columns).splitlines()[1].split() == ["a", "1.23457", "-", "1234567"]
    assert as_csv([Row], columns).splitlines() == [
        "name,number,blank,count",
        "a,1.23456789,,1234567",
    ]
    assert as_markdown([Row], columns).splitlines()[2] == "| a | 1.23457 |  | 1234567 |"
