"""The changelog has one section of each kind in a version, and one line for each change."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

CHANGELOG = Path(__file__).parents[2] / "CHANGELOG.md"
#: Sections of a version, in this order, and the longest line.
KINDS = ("Added", "Changed", "Deprecated", "Removed", "Fixed")
LONGEST = 140


def faults(text: str) -> list[str]:
    """Lines that are out of place."""
    found = []
    versions = re.split(r"^## .*\n", text, flags=re.MULTILINE)[1:]
    for version in versions:
        kinds = re.findall(r"^### (.*)$", version, flags=re.MULTILINE)
        if kinds != [kind for kind in KINDS if kind in kinds]:
            found.append(f"sections {kinds}: expected each once, in the order {KINDS}")
        lines = [line for line in version.partition("### ")[2].splitlines()[1:] if line]
        entries = [line for line in lines if not line.startswith("### ")]
        found += [
            f"'{line[:60]}': expected one line for a change" for line in entries if line[:2] != "- "
        ]
        found += [f"'{line[:60]}...' is too long" for line in entries if len(line) > LONGEST]
        found += [f"'{line[:60]}' appears twice" for line in {*entries} if entries.count(line) > 1]
    return found


def test_sections_and_lines():
    assert faults(CHANGELOG.read_text(encoding="utf-8")) == []


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("### Fixed\n\n- A.\n\n### Added\n\n- B.\n", "sections"),
        ("### Added\n\n- A.\n\n### Added\n\n- B.\n", "sections"),
        ("### Added\n\n- A long change,\n  in two lines.\n", "expected one line"),
        ("### Added\n\n- A.\n- A.\n", "appears twice"),
        (f"### Added\n\n- {'word ' * 30}.\n", "too long"),
    ],
)
def test_faults_are_found(text, fault):
    (found,) = faults(f"# Changelog\n\n## [Unreleased]\n\n{text}")
    assert fault in found
