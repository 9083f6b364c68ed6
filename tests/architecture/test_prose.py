"""Text of the repository is plain English: phrases that readers found hard, with a replacement for each.

Comments, docstrings, messages, pages and names of tests are searched, across lines. Add a phrase here if
a reader stumbles over it.
"""

from __future__ import annotations

import ast
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
    r"what (comes?|came) (back|out|in)\b": "the result",
    r"what (is|are) (left|new|written|stored|shown|told|missing elsewhere)\b": "name the thing",
    r"what (follows|differs|tells|distinguishes|decides|makes|gives|surrounds)\b": "name the thing",
    r"what messages\b": "name in messages",
    r"(is|are) left to\b": "is done by",
    r"as it stands\b": "without changes",
    r"as (it|they) (was|were) before\b": "unchanged",
    r"keeps? to (the|disjoint|its)\b": "follow, agree with",
    r"(nothing|something) is lost\b": "name the thing",
    r"for so many\b": "for this number of",
    r"(the|those) ones that\b": "repeat the noun",
    r"which of (it|them|which)\b": "name the choice",
    r"one by one by\b": "separately",
    r"(br(ing|ings|ought)) up (the|a|to)\b": "apply, increase",
    r"carr(y|ies) no more\b": "cannot carry more load",
    r"for ever\b": "forever",
    r"(start|begin|made?|starts|begins) anew\b": "start again",
    r"lest\b": "so that ... not",
    r"vouch(es)?\b": "guarantee",
    r"do(es)? without\b": "does not use, does not need",
    r"ma(ke|kes|de) up for\b": "cancel, balance",
    r"(take|takes|took|taking) away\b": "remove",
    r"not to be (written|changed)\b": "read only",
    r"(is|are) bought by\b": "costs",
    r"take (a|an|the) (smaller|larger|shorter|longer|other)\b": "use",
    r"than it was given\b": "than was supplied",
    r"of no (run|body|group)\b": "does not belong to",
    r"(is|are) code: (resume|read)\b": "executes the script",
    r"(has|have) not the\b": "does not have, lacks",
    r"no checkpoint of tawami\b": "is not a checkpoint",
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


#: First words of a docstring that is neither an imperative nor a noun phrase.
QUESTIONS = ("What", "Where", "Which", "Who", "How", "Nothing")


@pytest.mark.parametrize(
    "path", [p for p in texts() if p.suffix == ".py"], ids=lambda path: str(path.relative_to(ROOT))
)
def test_docstrings_begin_with_an_imperative_or_a_noun(path):
    kinds = (ast.Module, ast.ClassDef, ast.FunctionDef)
    nodes = [
        n for n in ast.walk(ast.parse(path.read_text(encoding="utf-8"))) if isinstance(n, kinds)
    ]
    words = [(ast.get_docstring(node) or "-").split()[0] for node in nodes]
    assert [word for word in words if word in QUESTIONS] == []


NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?!\w)")
#: Parts of a page that are no prose: front matter, code and directives; then code, mathematics, sources
#: with years, sizes such as 2 x 2, numbers of lists, values of parameters.
BLOCKS = re.compile(r"\A---\n.*?\n---\n|^(```+|:::+).*?^\1\n", flags=re.DOTALL | re.MULTILINE)
INLINE = re.compile(
    r"`[^`]*`|\$[^$]*\$|\([^()]*\d{4}[^()]*\)|\d+ x \d+|\b(?:19|20)\d\d\b|^\d+\. "
    r"|(?:nu|alpha|[^\W\da-z_]|K/.|h|k) (?:=|near|to|of) ?[-\d.e°]+"
)


def crowded(page: str) -> list[str]:
    """Paragraphs with more than five numbers, which belong in a table, or with three semicolons."""
    paragraphs = re.split(r"\n\s*\n|\n(?=\s*(?:[-*]|\d+\.) )", BLOCKS.sub("", page))
    prose = [p.strip() for p in paragraphs if not p.lstrip().startswith(("|", "#"))]
    found = [
        f"{len(n)} numbers: {p}" for p in prose if len(n := NUMBER.findall(INLINE.sub(" ", p))) > 5
    ]
    sentences = [s for p in prose for s in re.split(r"(?<=[.:!?])\s+", INLINE.sub(" ", p))]
    return found + [f"semicolons: {s}" for s in sentences if s.count(";") > 2]


@pytest.mark.parametrize(
    "path",
    [
        p
        for p in texts()
        if p.suffix == ".md" and p.name != "CHANGELOG.md" and "cases" not in p.parts
    ],
    ids=lambda path: str(path.relative_to(ROOT)),
)
def test_paragraphs_have_few_numbers(path):
    assert crowded(path.read_text(encoding="utf-8")) == []


@pytest.mark.parametrize(
    ("page", "count"),
    [
        ("The error is 1, 2, 3, 4 and 5 %.", 0),
        ("The error is 1, 2, 3, 4, 5 and\n6e-2 %.", 1),
        ("With nu = 0.3 on 2 x 2 cells the errors are 1, 2, 3, 4 and 5 %.", 0),
        ("| 1 | 2 | 3 | 4 | 5 | 6 |\n", 0),
        ("```sh\n1 2 3 4 5 6\n```\n", 0),
        ("One; two; three; four.", 1),
    ],
)
def test_crowded_paragraphs_are_found(page, count):
    assert len(crowded(page)) == count
