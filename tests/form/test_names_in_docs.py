"""The page on weak forms lists every declaration and every name of a residual, and no other."""

from __future__ import annotations

import re
from pathlib import Path

import tawami
from tawami.form import form, scalar, vector
from tawami.form.symbols import Symbols

PAGE = Path(tawami.__file__).parents[1] / "docs/forms.md"


def first_column(heading):
    """Names in backticks in the first column of the first table of a section."""
    section = PAGE.read_text().split(f"## {heading}\n", 1)[1].split("\n## ", 1)[0]
    table = section.split("| --- | --- |\n", 1)[1].split("\n\n", 1)[0]
    return {
        name for row in table.splitlines() for name in re.findall("`(\\w+)`", row.split("|")[1])
    }


def test_every_declaration():
    assert first_column("Declarations") == {*form.DECLARATIONS, "residual"}


def test_every_name_of_a_residual():
    fields = {"u": vector("w"), "p": scalar("q")}
    names = set()
    for strain in ("small", "finite"):
        made = tawami.Form(fields=fields, residual=lambda w: w, strain=strain)
        names |= set(Symbols(made, {}).names)
    assert first_column("Names of a residual") == names - {"u", "w", "p", "q"}
    assert set(form.RESERVED) == names - {"u", "w", "p", "q"}
