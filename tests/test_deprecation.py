"""Old names still work, and say so where a user sees it."""

from __future__ import annotations

import subprocess
import sys
import warnings

import pytest
from test_stepping import block

import tawami
from tawami.deprecation import renamed, renamed_parameter


@renamed_parameter("colour", "color", goes_in="0.3")
def paint(wall: str, *, color: str = "white") -> str:
    """Paint a wall."""
    return f"{wall} {color}"


painted = renamed("painted", goes_in="0.4")(paint)


def test_a_renamed_parameter():
    with pytest.warns(tawami.TawamiDeprecationWarning) as caught:
        assert paint("left", colour="red") == "left red"
    (warning,) = caught
    for word in ("paint(colour=...)", "paint(color=...)", "tawami 0.3"):
        assert word in str(warning.message)
    assert warning.filename == __file__
    with pytest.raises(tawami.InputError, match="colour is color now: expected one of them"):
        paint("left", colour="red", color="blue")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert paint("left", color="red") == "left red"
    assert (paint.__name__, paint.__doc__) == ("paint", "Paint a wall.")


def test_a_renamed_function():
    with pytest.warns(
        tawami.TawamiDeprecationWarning, match=r"painted\(...\) is called paint"
    ) as seen:
        assert painted("left", color="red") == "left red"
    assert seen[0].filename == __file__
    assert "0.4" in str(seen[0].message)


def test_settle_takes_its_old_parameter():
    scene = block()
    scene.gravity((0.0, -20.0))
    with (
        pytest.warns(tawami.TawamiDeprecationWarning, match=r"settle\(max_resets=...\)"),
        pytest.raises(tawami.ConvergenceError, match="after 1 resets"),
    ):
        tawami.settle(scene, most=1)


def test_it_is_shown_wherever_it_is_called_from(tmp_path):
    """By Python's own filters, in a script and in a module that it imports."""
    (tmp_path / "helper.py").write_text(
        "import tawami\n"
        "def call():\n"
        "    try:\n"
        "        tawami.settle(None, most=0)\n"
        "    except Exception:\n"
        "        pass\n"
    )
    (tmp_path / "driver.py").write_text("import helper\nhelper.call()\n")
    run = subprocess.run(
        [sys.executable, "driver.py"], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert run.stderr.count("TawamiDeprecationWarning: settle(most=...) is called") == 1
    assert "helper.py:4" in run.stderr


def test_every_warning_has_the_base():
    for name in tawami.__all__:
        kind = getattr(tawami, name)
        if name.endswith("Warning") and name != "TawamiDeprecationWarning":
            assert issubclass(kind, tawami.TawamiWarning)
            assert issubclass(kind, UserWarning)
        if name.endswith("Error"):
            assert issubclass(kind, tawami.TawamiError)
    assert issubclass(tawami.TawamiDeprecationWarning, FutureWarning)


def test_every_error_and_warning_stands_in_the_hierarchy():
    words = tawami.errors.__doc__.split()
    assert all(name in words for name in tawami.errors.__all__)
