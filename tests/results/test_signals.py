"""Signals: SIGINT and SIGTERM leave a last checkpoint, SIGKILL the one before; the run resumes."""

from __future__ import annotations

import os
import signal
import subprocess
import sys

import numpy as np
import pytest
from programs import PYTHONPATH, on_ranks
from runs import results_of, run

from tawami.base import archive

#: Moves the block for sixty steps. In step STOP it waits until a line comes in, so that the test can
#: send a signal before; or it sends itself SIGTERM.
DRIVER = """
import os, signal, sys
from mpi4py import MPI
from runs import run
stop, own = int(os.environ["STOP"]), "OWN" in os.environ
def each(_):
    global stop
    stop -= 1
    if stop == 0 and MPI.COMM_WORLD.rank == 0:
        if own:
            signal.raise_signal(signal.SIGTERM)
        else:
            print("now", flush=True)
            sys.stdin.readline()
run(sys.argv[1], end=0.3, checkpoint_steps=5, each=each)
"""


@pytest.fixture
def driver(tmp_path):
    path = tmp_path / "driver.py"
    path.write_text(DRIVER)
    return path


def finished(folder):
    """Run or resume in this process; the particles at the end."""
    return run(folder, end=0.3, checkpoint_steps=5)[0].scene.particles.rows()


@pytest.mark.direct  # the processes have the solver by default
@pytest.mark.parametrize(
    ("sent", "code"), [(signal.SIGKILL, -9), (signal.SIGTERM, 143), (signal.SIGINT, -2)]
)
def test_a_signal_ends_a_run_which_then_resumes_to_the_bit(tmp_path, driver, sent, code):
    folder = tmp_path / "run"
    process = subprocess.Popen(
        [sys.executable, str(driver), str(folder)],
        env=os.environ | {"PYTHONPATH": PYTHONPATH, "STOP": "13"},
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert process.stdout is not None
    assert process.stdout.readline() == "now\n"
    process.send_signal(sent)
    _, errors = process.communicate("" if sent == signal.SIGKILL else "\n", timeout=100)
    assert process.returncode == code, errors
    newest = results_of(folder).checkpoints[-1].name
    if sent == signal.SIGKILL:
        assert newest == "01-motion-00000010.npz"
    else:
        assert newest == "01-motion-00000013.npz"
        assert f"motion: stopped by {sent.name} at" in errors
        assert f"tawami resume {folder}" in errors
    assert finished(folder).tobytes() == finished(tmp_path / "whole").tobytes()


def test_a_signal_while_the_last_checkpoint_is_written_is_not_lost(tmp_path, monkeypatch):
    write = archive.write

    def signalled(*arguments):
        write(*arguments)
        signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(archive, "write", signalled)
    with pytest.raises(KeyboardInterrupt):
        run(tmp_path / "run", checkpoint_steps=None)


@pytest.mark.mpi
@pytest.mark.direct  # the ranks have the solver by default
def test_a_run_resumes_on_another_number_of_ranks(tmp_path, driver):
    """Begun on one rank, resumed on two and on three, where SIGTERM stops it, and finished on one."""
    whole = finished(tmp_path / "whole")
    folder = tmp_path / "run"
    run(folder, end=0.05, checkpoint_steps=5)
    for number in (2, 3):
        several = on_ranks(number, driver, folder, STOP="8", OWN="1")
        assert several.stderr.count("motion: stopped by SIGTERM at") == 1, several.stderr
        assert f"tawami on {number} ranks" in (folder / "log.txt").read_text()
    assert results_of(folder).checkpoints[-1].name == "01-motion-00000026.npz"
    end = finished(folder)
    assert np.abs(end - whole).max() <= 1e-10 * np.abs(whole).max()
    assert (end != whole).any()  # the ranks took part
