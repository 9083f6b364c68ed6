"""The command `tawami trade`: speed against accuracy of a script, and a copy with another setting."""

from __future__ import annotations

import argparse
import re
from pathlib import Path

from tawami.base import checks
from tawami.command.script import Script

UNITS = {"": 1.0, "s": 1.0, "m": 60.0, "h": 3600.0}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.add_argument("script", metavar="SCRIPT", help="a Python file with a function build")
    parser.add_argument(
        "--quantity", metavar="Q", action="append",
        help="a quantity that build returns; may be repeated (default: all numbers)",
    )  # fmt: skip
    parser.add_argument(
        "--budget", metavar="T", type=seconds, default=60.0,
        help="time of all runs together, as 60s, 10m or 1h (default: 60s)",
    )  # fmt: skip
    parser.add_argument(
        "--tolerance", metavar="E", type=part, default=0.01,
        help="error of the recommended setting, as 0.5%% (default: 1%%)",
    )  # fmt: skip
    parser.add_argument(
        "--jobs", metavar="N", type=jobs,
        help="runs at a time, with one thread each (default: the number of processors)",
    )  # fmt: skip
    parser.add_argument(
        "--folder", metavar="F", help="folder of the results (default: results/trade/NAME)"
    )
    parser.add_argument(
        "--apply", metavar="E", type=part,
        help="write a copy of the script with the fastest setting within this error, as 0.5%%",
    )  # fmt: skip


def seconds(text: str) -> float:
    """A time of the command line [s]: a number with s, m or h."""
    found = re.fullmatch(r"(\d+\.?\d*|\.\d+)([smh]?)", text)
    if found is None or float(found[1]) == 0:
        raise argparse.ArgumentTypeError(f"'{text}': expected a positive time, as 60s, 10m or 1h")
    return float(found[1]) * UNITS[found[2]]


def part(text: str) -> float:
    """A relative error of the command line: 0.5% or 0.005."""
    found = re.fullmatch(r"(\d+\.?\d*|\.\d+)(%?)", text)
    value = 0.0 if found is None else float(found[1]) / (100 if found[2] else 1)
    if not 0 < value < 1:
        raise argparse.ArgumentTypeError(f"'{text}': expected an error below 100%, as 0.5%")
    return value


def jobs(text: str) -> int:
    """Runs at a time of the command line."""
    if not re.fullmatch(r"[1-9]\d*", text):
        raise argparse.ArgumentTypeError(f"'{text}': expected a whole number, at least 1")
    return int(text)


def run(asked: argparse.Namespace) -> int:
    """Carry out the command."""
    from tawami.study.knobs import write_applied  # here: it imports SciPy
    from tawami.study.trade import default_folder, trade

    path: Path = checks.path("script", asked.script)
    Script(path, None).check()
    tolerance = asked.apply or asked.tolerance
    folder = checks.path("folder", asked.folder or default_folder(path.stem))
    result = trade(
        path, asked.quantity, asked.budget, tolerance=tolerance, folder=folder, jobs=asked.jobs
    )
    print(result)
    print(f"{folder / path.stem}.csv and .png are written")
    if asked.apply is not None:
        copy = write_applied(path, result.recommended().knobs, tolerance)
        print(f"{copy} is written: {path.name} with the recommended setting as its defaults")
    return 0
