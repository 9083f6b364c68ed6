"""`import tawami` imports little: the names of the package are imported when they are used."""

from __future__ import annotations

import ast
import json
import os
from pathlib import Path

import pytest
from programs import python

import tawami
from tawami.base.dependencies import ALONE, LAUNCHED, quick_start

#: Packages that only some scripts need, or that take long to import.
LATER = {
    "basix", "cffi", "dolfinx", "ffcx", "matplotlib", "meshio", "pkg_resources", "scipy", "shapely",
    "tqdm", "ufl",
}  # fmt: skip


def loaded_after(code: str) -> set[str]:
    """Top-level names of the modules that a process has loaded after this code."""
    last = "import json, sys; print(json.dumps([*sys.modules]))"
    run = python("-c", f"{code}\n{last}")
    assert run.returncode == 0, run.stderr
    return {name.split(".")[0] for name in json.loads(run.stdout.splitlines()[-1])}


def test_import_loads_no_package_that_is_needed_later():
    assert not loaded_after("import tawami; dir(tawami)") & LATER


def test_a_scene_loads_no_package_for_pictures_or_meshes():
    loaded = loaded_after("from tawami import Dynamics, Grid, Scene, box, linear_elastic")
    assert "dolfinx" in loaded
    assert not loaded & {"matplotlib", "meshio", "shapely", "tqdm"}


def test_all_names_are_those_of_the_stub():
    stub = Path(tawami.__file__).with_suffix(".pyi")
    assert isinstance(tawami.__all__, list)
    (listed,) = (
        ast.literal_eval(node.value)
        for node in ast.parse(stub.read_text(encoding="utf-8")).body
        if isinstance(node, ast.Assign)
    )
    assert tawami.__all__ == listed
    for name in listed:
        assert getattr(tawami, name) is vars(tawami)[name]
    assert set(listed) <= set(dir(tawami))


def test_a_wrong_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="module 'tawami' has no attribute 'Sceen'"):
        tawami.Sceen  # noqa: B018
    with pytest.raises(ImportError, match="cannot import name 'Sceen'"):
        from tawami import Sceen  # noqa: F401


def test_import_leaves_the_environment_as_it_was():
    code = "import os; before = dict(os.environ); import tawami; assert before == dict(os.environ)"
    assert python("-c", code).returncode == 0


def test_settings_of_mpi_are_for_a_process_that_no_launcher_started(monkeypatch):
    for name in [name for name in os.environ if name.startswith((*LAUNCHED, *ALONE))]:
        monkeypatch.delenv(name)
    with quick_start():
        assert {name: os.environ[name] for name in ALONE} == ALONE
    monkeypatch.setenv("OMPI_MCA_pml", "cm")
    with quick_start():
        assert dict(os.environ)["OMPI_MCA_pml"] == "cm"
    monkeypatch.delenv("OMPI_MCA_pml")
    monkeypatch.setenv("PMIX_RANK", "0")
    with quick_start():
        assert not set(os.environ) & set(ALONE)
