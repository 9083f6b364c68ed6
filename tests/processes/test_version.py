"""One version: that of Cargo.toml, in the compiled part, in Python, for pip and on the command line."""

from __future__ import annotations

import importlib.metadata
import tomllib

from programs import ROOT, python

import tawami
from tawami import _rust

VERSION = tomllib.loads((ROOT / "Cargo.toml").read_text())["package"]["version"]


def test_there_is_one_version():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert "version" not in project
    assert "version" in project["dynamic"]
    assert (
        VERSION == _rust.__version__ == tawami.__version__ == importlib.metadata.version("tawami")
    )
    cited = (ROOT / "CITATION.cff").read_text()
    assert f"version: {VERSION}\n" in cited.replace('"', "")
    assert f"version = {{{VERSION}}}" in (ROOT / "README.md").read_text()


def test_the_version_needs_no_other_package():
    code = "import sys, tawami; print(tawami.__version__, 'dolfinx' in sys.modules)"
    assert python("-c", code, check=True).stdout == f"{VERSION} False\n"
    assert python("-m", "tawami", "--version", check=True).stdout == f"tawami {VERSION}\n"
