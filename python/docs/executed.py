"""Run the cases and the code marked `{run}` that pages show, unless nothing has changed.

A record holds the fingerprint of all files that a run read; it is written last. A run that fails is an
error of `make docs`.
"""

from __future__ import annotations

import contextlib
import hashlib
import importlib
import io
import json
import os
import re
import shutil
import subprocess
import sys
import textwrap
import traceback
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

from sources import ROOT

RESULTS = ROOT / "results" / "docs"
#: A block of code that is run; after `{run}` the class of the error that it must raise, if any.
BLOCK = re.compile(r"^```\{run\} *(\w*)\n(.*?)^```\n", flags=re.DOTALL | re.MULTILINE)
#: Files that every run reads.
SHARED = ("python/tawami/**/*.py", "forms/*.py", "rust/**/*.rs", "Cargo.lock")
MINUTES = 60
#: Cases that only print.
WITHOUT_FILES = ("self_weight", "projection", "writing")
#: Options of cases that would run for more than three minutes.
SHORTER = {
    "elastica": ("--steps", "40"),
    "footing": ("--cells", "8"),
    "bearing_capacity": ("--cells", "2"),
}


class RunError(Exception):
    """A run that failed, or did not raise the expected error."""


@dataclass(frozen=True)
class Output:
    """Printed text, pictures and duration [s] of a run."""

    text: str
    pictures: list[Path]
    seconds: float


def fingerprint(patterns: Iterable[str], *more: str) -> str:
    """Fingerprint of the files that match patterns, from the top of the repository, and of texts."""
    total = hashlib.sha256("\0".join(more).encode())
    for path in sorted({path for pattern in patterns for path in ROOT.glob(pattern)}):
        if path.is_file():
            total.update(f"\0{path.relative_to(ROOT)}\0".encode() + path.read_bytes())
    return total.hexdigest()


def cached(folder: Path, mark: str, work: Callable[[], str]) -> Output:
    """Output of `work`, which draws into a folder; of the last run if that had the same fingerprint."""
    record = folder / "record.json"
    with contextlib.suppress(OSError, ValueError):
        old = json.loads(record.read_text())
        if old["fingerprint"] == mark:
            return Output(old["text"], sorted(folder.glob("*.png")), old["seconds"])
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    start = perf_counter()
    text = work()
    seconds = perf_counter() - start
    record.write_text(json.dumps({"fingerprint": mark, "text": text, "seconds": seconds}))
    return Output(text, sorted(folder.glob("*.png")), seconds)


def command(
    words: Sequence[str], folder: Path, what: str, environment: Mapping[str, str] = os.environ
) -> str:
    """Standard output of a command.

    Raises:
        RunError: Its exit code is not 0, or it does not end.
    """
    own = {**environment, "MPLBACKEND": "Agg", "PYTHONPATH": str(ROOT)}
    print(f"docs: {what}", file=sys.stderr, flush=True)
    try:
        run = subprocess.run(
            words, cwd=folder, env=own, stdin=subprocess.DEVNULL, capture_output=True,
            text=True, check=False, timeout=60 * MINUTES,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        raise RunError(f"{what} did not end within {MINUTES} minutes") from None
    if run.returncode:
        raise RunError(f"{what} ended with {run.returncode}:\n{run.stderr[-3000:]}")
    return run.stdout


def case(room: str, name: str) -> Output:
    """Run a case as `python -m cases.ROOM.NAME` does."""
    folder, module = RESULTS / "cases" / name, f"cases.{room}.{name}"
    own = (f"cases/{room}/{name}.py", f"cases/{room}/{name}/*.py", "cases/common/*.py")
    options = [] if name in WITHOUT_FILES else ["--results", str(folder)]
    words = [sys.executable, "-m", module, *SHORTER.get(name, ()), *options]
    mark = fingerprint((*SHARED, *own), *SHORTER.get(name, ()))
    output = cached(folder, mark, lambda: command(words, ROOT, f"python -m {module}"))
    return Output(output.text.replace(f"{ROOT}/", ""), output.pictures, output.seconds)


def blocks(page: str, text: str) -> str:
    """A page with its `{run}` blocks replaced by code and output; pictures are in `executed/PAGE`."""
    found = BLOCK.findall(text)
    if not found:
        return text
    folder = RESULTS / "executed" / page

    def work() -> str:
        (folder / "blocks.json").write_text(json.dumps(found))
        return command([sys.executable, __file__, "blocks.json"], folder, f"the code of {page}.md")

    output = cached(folder, fingerprint(SHARED, *map("\0".join, found)), work)
    printed = iter(json.loads(output.text.splitlines()[-1]))

    def shown(match: re.Match[str]) -> str:
        says = next(printed)
        code = f"```python\n{match[2]}```\n"
        return code + (f"\n```text\n{_wrapped(says.rstrip())}\n```\n" if says.strip() else "")

    return BLOCK.sub(shown, text)


def _wrapped(text: str) -> str:
    """Messages of errors and warnings in short lines."""
    lines = text.splitlines()
    sentence = re.compile(r"\w+(Error|Warning): ")
    return "\n".join(
        textwrap.fill(line, 92, subsequent_indent="    ") if sentence.match(line) else line
        for line in lines
    )


def run_blocks(found: Sequence[tuple[str, str]]) -> list[str]:
    """Output of each block, run one after another in one namespace.

    Raises:
        RunError: A block raised another error than expected, or none.
    """
    names: dict[str, Any] = {"__name__": "__page__"}
    return [_printed(code, expected, names) for expected, code in found]


def _printed(code: str, expected: str, names: dict[str, Any]) -> str:
    raised = ""
    with (
        contextlib.redirect_stdout(io.StringIO()) as out,
        warnings.catch_warnings(record=True) as w,
    ):
        warnings.simplefilter("default", UserWarning)
        try:
            exec(compile(code, "<page>", "exec"), names)
        except Exception as error:
            raised = type(error).__name__
            if raised != expected:
                raise RunError(f"{code}\n{traceback.format_exc()}") from error
            out.write(f"{raised}: {error}\n")
    if raised != expected:
        raise RunError(f"{code}\nexpected {expected}, but nothing was raised")
    said = [f"{m.category.__name__}: {m.message}" for m in w if issubclass(m.category, UserWarning)]
    return "\n".join([*said, out.getvalue()])


if __name__ == "__main__":
    importlib.import_module("logging").disable(20)  # compiling forms logs much
    print(json.dumps(run_blocks(json.loads(Path(sys.argv[1]).read_text()))))
