"""The log of a run, and the line that shows its progress at a terminal."""

from __future__ import annotations

import errno
import io
import sys
import warnings

import pytest
from runs import Kill, Killed, run

import tawami
from tawami.base import line
from tawami.results import progress


@pytest.mark.usefixtures("log_on")
def test_the_log_holds_every_step_of_an_interrupted_run(tmp_path):
    with pytest.raises(Killed):
        run(tmp_path / "run", each=Kill(8))
    run(tmp_path / "run")
    lines = (tmp_path / "run" / "log.txt").read_text().splitlines()
    steps = [line for line in lines if ": step " in line]
    assert len(steps) == 8 + 4
    assert "motion: step 10 to 0.05 s, size 0.005, " in steps[-1]
    assert "Newton iterations to " in steps[-1]
    assert steps[-1].endswith("16 particles")
    assert any("resumes at 0.03 s" in line for line in lines)


@pytest.mark.usefixtures("log_on")
def test_the_log_holds_warnings(tmp_path):
    def warns(_):
        warnings.warn("a noteworthy thing", tawami.EnergyWarning, stacklevel=1)

    with pytest.warns(tawami.EnergyWarning):
        run(tmp_path / "run", each=warns)
    assert "WARNING EnergyWarning: a noteworthy thing" in (tmp_path / "run" / "log.txt").read_text()


@pytest.mark.usefixtures("log_on")
def test_the_environment_sets_the_level_of_the_log(tmp_path, monkeypatch, capfd):
    monkeypatch.setenv("TAWAMI_LOG_LEVEL", "info")
    run(tmp_path / "a")
    assert capfd.readouterr().err.count("INFO motion: step ") == 10
    monkeypatch.setenv("TAWAMI_LOG_LEVEL", "loud")
    with pytest.raises(tawami.InputError, match="TAWAMI_LOG_LEVEL = 'LOUD': expected one of DEBUG"):
        run(tmp_path / "b")


class Terminal(io.StringIO):
    def isatty(self):
        return True


def test_a_terminal_shows_one_line(tmp_path, monkeypatch):
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    monkeypatch.setattr(line, "INTERVAL", 0.0)
    monkeypatch.setenv("COLUMNS", "120")
    run(tmp_path / "run")
    text = terminal.getvalue()
    states = text.split("\r")[1:]
    assert len(states) == 10
    assert text.count("\n") == 1
    for part in ("motion 0.05 of 0.05 s", "step 10 (0.005)", "Newton", "16 particles", "0 s left"):
        assert part in states[-1]
    assert all(len(state.rstrip("\n")) == 119 for state in states)


def test_nothing_is_shown_without_a_terminal(tmp_path, capfd):
    run(tmp_path / "run")
    assert capfd.readouterr().err == ""


def test_a_terminal_that_is_closed_does_not_end_a_run(tmp_path, monkeypatch):
    class Closed(Terminal):
        def write(self, text):
            raise OSError(errno.EIO, "closed")

    monkeypatch.setattr(sys, "stderr", Closed())
    motion, _ = run(tmp_path / "run")
    assert motion.time == pytest.approx(0.05)


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(0.2, "0 s"), (59.6, "1 min 0 s"), (61, "1 min 1 s"), (7384, "2 h 3 min"), (2e5, "2 d 7 h")],
)
def test_durations_are_rounded(seconds, text):
    assert progress.duration(seconds) == text
