"""Fonts and colours of figures are in one file, `picture/style.py`."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
#: Named colours of matplotlib, its maps, settings and sizes of titles and legends.
OWN = re.compile(r"[\"']tab:|cmap=[\"']|rcParams|\b(set_title|legend|set_[xy]label)\(.*fontsize=")
STYLE = {"python/tawami/picture/style.py", "cases/common/figure.py", "python/docs/kernel.py"}
FILES = sorted(
    path
    for folder in ("cases", "python/tawami", "python/docs")
    for path in (ROOT / folder).rglob("*.py")
    if str(path.relative_to(ROOT)) not in STYLE
)


def test_the_pattern_finds_settings_of_a_figure():
    assert OWN.search('axes.plot(x, y, color="tab:red")')
    assert OWN.search("axes.legend(loc='best', fontsize=8)")
    assert not OWN.search("axes.scatter(x, y, cmap=style.SIGNED)")


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(ROOT)))
def test_figures_have_the_style_of_the_package(path):
    assert OWN.findall(path.read_text(encoding="utf-8")) == []
