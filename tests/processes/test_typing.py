"""The public API as a type checker sees it: drivers pass mypy --strict, mistakes are found."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from tawami.command.new import TEMPLATES

TESTS = Path(__file__).parent
DRIVER = TESTS / "typed_driver.py"


@pytest.fixture(scope="module")
def found(tmp_path_factory) -> dict[tuple[str, int], set[str]]:
    """(File, line) -> codes of mypy's errors in the driver and in the templates."""
    cache = tmp_path_factory.mktemp("mypy")
    command = [
        sys.executable, "-m", "mypy", "--strict", "--config-file=", "--cache-dir", str(cache),
        "--no-error-summary", "--hide-error-context", "--no-color-output", str(DRIVER),
        *map(str, TEMPLATES.glob("*.py")),
    ]  # fmt: skip
    run = subprocess.run(
        command, capture_output=True, text=True, check=False, timeout=100, cwd=cache
    )
    assert run.returncode in (0, 1), run.stderr + run.stdout
    errors: dict[tuple[str, int], set[str]] = {}
    for line in run.stdout.splitlines():
        match = re.search(r"([^/\s]+\.py):(\d+): error: .*\[([a-z-]+)\]$", line)
        if match is None:
            assert ": note: " in line, line
            continue
        errors.setdefault((match[1], int(match[2])), set()).add(match[3])
    return errors


def test_a_driver_passes_and_every_mistake_is_found(found):
    expected = {}
    for number, line in enumerate(DRIVER.read_text().splitlines(), start=1):
        if "  # wrong: " in line:
            expected[number] = set(line.split("  # wrong: ")[1].split())
    assert len(expected) > 25
    refused = {line: codes for (name, line), codes in found.items() if name == DRIVER.name}
    assert refused.keys() == expected.keys()
    assert all(codes <= expected[line] for line, codes in refused.items()), refused


def test_the_templates_are_typed(found):
    assert {path.name for path in TEMPLATES.glob("*.py")} == {"statics.py", "dynamics.py"}
    assert {name for name, _ in found} == {DRIVER.name}
