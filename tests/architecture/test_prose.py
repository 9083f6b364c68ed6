"""Text of the repository is plain English: phrases that readers found hard, with a replacement for each.

Comments, docstrings, messages, pages and names of tests are searched, across lines. Add a phrase here if
a reader stumbles over it.
"""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FOLDERS = ("cases", "forms", "python", "rust", "tests")
SUFFIXES = (".md", ".py", ".pyi", ".rs", ".toml")
#: Phrase, as a regular expression, and what to write instead.
PHRASES = {
    r"(go|goes|going|gone|went) on\b(?! (strike|foot))": "continue, resume",
    r"(take|takes|taken|took) up\b(?! to)": "apply, use, continue",
    r"(numbers|values|entries|lines) that are none\b": "NaN and infinity",
    r"counts? as none\b": "is ignored",
    r"(let|lets|letting) go\b": "release, stop",
    r"(come|comes|came) of (nothing|it|that)\b": "spurious, results from",
    r"what there (is|are|was|were)\b": "name the thing",
    r"whose (it|they) (is|are)\b": "of which run, whose owner",
    r"of yours\b": "your own",
    r"of one's own\b": "user-defined",
    r"(stand|stands|standing|stood) in( for)?\b": "replace, is in",
    r"stands? (there|for all)\b": "is there, represents",
    r"(with|by|in|gets?|has|have) (a|one|its|their) sentences?\b": "with an error message",
    r"(that|which) (is|are) there\b": "existing",
    r"round in circles\b": "does not converge",
    r"whole or not at all\b": "is complete",
    r"says? so\b": "warns, is declared",
    r"(is|are|was|were) (told|said)\b": "is reported",
    r"what (it|they) (wrote|found|gave|say|says|hold|holds|takes?|needs?)\b": "name the thing",
    r"(what|which) comes out\b": "the result",
    r"once more\b": "again",
    r"beside (finite|the closed|Euler|Prandtl|Timoshenko|its theory)\w*": "compared with",
    r"but for (the|its|round)\b": "except, up to",
    r"out of nothing\b": "spurious",
}
#: The same with any number of blanks between words.
SEARCHED = {
    phrase: re.compile(r"\b" + phrase.replace(" ", " +"), flags=re.IGNORECASE) for phrase in PHRASES
}


def texts() -> list[Path]:
    inside = (path for folder in FOLDERS for path in (ROOT / folder).rglob("*"))
    outside = (path for path in ROOT.iterdir() if path.is_file())
    own = Path(__file__)
    return sorted(p for p in {*inside, *outside} if p.suffix in SUFFIXES and p != own)


def plain(text: str) -> str:
    """Text with line breaks, markers of comments and underscores as blanks; its length is unchanged."""
    marks = (
        r"(?m)^[ \t]*(?:#:?|//[/!]?)|\"\n *f?\"|[_\n]"  # the second joins strings of one message
    )
    return re.sub(marks, lambda found: " " * len(found[0]), text)


def hits(text: str) -> list[str]:
    """Line, phrase and replacement of each hit."""
    blanks = plain(text)
    return [
        f"line {text.count(chr(10), 0, hit.start()) + 1}: '{' '.join(hit[0].split())}', write: {advice}"
        for phrase, advice in PHRASES.items()
        for hit in SEARCHED[phrase].finditer(blanks)
    ]


@pytest.mark.parametrize("path", texts(), ids=lambda path: str(path.relative_to(ROOT)))
def test_text_is_plain(path):
    assert hits(path.read_text(encoding="utf-8")) == []


@pytest.mark.parametrize(
    ("text", "phrase"),
    [
        ("# It is let\n    # go here.", "let go"),
        ("def test_it_gets_a_sentence(): ...", "gets a sentence"),
        ('raise InputError("the run goes "\n    "on")', "goes on"),
    ],
)
def test_phrases_are_found_across_lines_and_in_names(text, phrase):
    (hit,) = hits(text)
    assert hit.startswith(f"line 1: '{phrase}'")


def test_plain_text_has_no_hits():
    assert hits("The run resumes. No value is missing; `x is None` is code.") == []
