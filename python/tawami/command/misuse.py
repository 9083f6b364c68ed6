"""Messages about arguments that a command does not have, with a command line that works."""

from __future__ import annotations

import argparse
import re
import shlex
from collections import Counter

from tawami.base.text import meant


def joined(words: list[str]) -> list[str]:
    """Arguments in which `--budget -5s` is `--budget=-5s`: a negative value is no option."""
    found = list[str]()
    for word in words:
        if re.match(r"-\.?\d", word) and found and re.fullmatch(r"--[a-z-]+", found[-1]):
            found[-1] += f"={word}"
        else:
            found.append(word)
    return found


def unrecognised(asked: argparse.Namespace, unknown: list[str], own: list[str]) -> str:
    """Message about arguments that a command does not have.

    Args:
        asked: What was recognised.
        unknown: What was not.
        own: All arguments.
    """
    if asked.name != "tawami run":
        return _unknown(asked, unknown)
    left, words = (
        Counter(unknown if asked.script is None else [*unknown, asked.script]),
        list[str](),
    )
    for word in reversed(own):  # in their order: of --n 3 case.py, 3 was taken for the script
        if left[word]:
            left[word] -= 1
            words.insert(0, word)
    again = ["-m", asked.module]
    if asked.module is None:
        again = [next((word for word in words if word.endswith(".py")), asked.script)]
        words.remove(*again)
    again += ["--ranks", str(asked.ranks)] if asked.ranks else []
    again += [f"--{asked.existing}"] if asked.existing else []
    again += ["--log-level", asked.log_level] if asked.log_level else []
    advice = command_line("run", *again, "--", *words)
    return f"{_unknown(asked, words)}; arguments of the script follow --: {advice}"


def _unknown(asked: argparse.Namespace, words: list[str]) -> str:
    """Arguments, with the option that the first of them nearly is."""
    options = re.findall(r"--([a-z-]+)", asked.parser.format_usage())
    hint = meant(words[0].lstrip("-").partition("=")[0], options).replace("'", "'--", 1)
    return f"unrecognized arguments: {shlex.join(words)}{hint}"


def command_line(*words: str) -> str:
    """A command line for messages."""
    return shlex.join(["tawami", *words])
