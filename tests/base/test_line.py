"""The line of progress in a notebook, with and without its packages."""

from __future__ import annotations

import sys
import warnings
from types import ModuleType, SimpleNamespace

import pytest

from tawami.base import line


@pytest.fixture
def notebook(monkeypatch):
    """A process that looks like the kernel of a notebook without ipywidgets."""
    ipython = ModuleType("IPython")
    ipython.get_ipython = lambda: SimpleNamespace(kernel=None)
    monkeypatch.setitem(sys.modules, "IPython", ipython)
    monkeypatch.setitem(sys.modules, "ipywidgets", None)


@pytest.mark.usefixtures("notebook")
def test_a_notebook_gets_a_bar_without_a_warning(capfd):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        bar = line.Line(None)
        bar.show("0.1 of 0.2 s", 0.5)
        bar.show("0.2 of 0.2 s", 1.0, now=True)
        bar.end()
    text = capfd.readouterr().err
    assert "50%" in text
    assert "100%" in text
    assert "| 0.2 of 0.2 s" in text


@pytest.mark.usefixtures("notebook")
def test_a_notebook_without_tqdm_gets_a_line(monkeypatch, capfd):
    monkeypatch.setattr(line, "find_spec", lambda name: None)
    bar = line.Line(None)
    bar.show("0.1 of 0.2 s", 0.5)
    bar.end()
    assert capfd.readouterr().err.strip() == "0.1 of 0.2 s"


@pytest.mark.usefixtures("notebook")
def test_a_bar_can_be_switched_off(capfd):
    bar = line.Line(False)
    bar.show("0.1 of 0.2 s", 0.5, now=True)
    bar.end()
    assert capfd.readouterr().err == ""
