"""The command `tawami trade`: files, the copy of the script with a setting, exit codes."""

from __future__ import annotations

from pathlib import Path

import pytest

from tawami.command.main import main

SCRIPT = """
import time
from typing import Annotated

def build(h: Annotated[float, (1/2, 1/4, 1/8, 1/16)] = 1 / 2):
    time.sleep(0.005 / h)
    return {"tip": 1 + h**4}
"""


def test_the_command(tmp_path, monkeypatch, capsys):
    script = tmp_path / "case.py"
    script.write_text(SCRIPT)
    monkeypatch.chdir(tmp_path)
    assert main(["trade", "case.py", "--quantity", "tip", "--budget", "50s", "--apply", "2%"]) == 0
    assert "case_2_percent.py is written" in capsys.readouterr().out
    assert "= 0.25)" in (tmp_path / "case_2_percent.py").read_text()
    written = {path.name for path in Path("results/trade/case").glob("[!.]*")}
    assert written == {"case.csv", "case.png", "runs.jsonl"}
    for line, message in (
        (["case.py", "--apply", "2%"], "'case_2_percent.py' exists"),
        (["case.py", "--quantity", "top"], "quantity 'top' of 'case': expected one of 'tip'"),
    ):
        assert main(["trade", *line]) == 2
        assert message in capsys.readouterr().err
    for option, value, message in (
        ("--budget", "soon", "'soon': expected a positive time, as 60s, 10m or 1h"),
        ("--budget", "-5s", "'-5s': expected a positive time"),
        ("--apply", "200%", "'200%': expected an error below 100%"),
        ("--jobs", "x", "'x': expected a whole number"),
    ):
        with pytest.raises(SystemExit):
            main(["trade", "case.py", option, value])
        assert message in capsys.readouterr().err
    script.write_text("x = 1\n")
    assert main(["trade", "case.py"]) == 2
    assert "has no function build" in capsys.readouterr().err
