"""The command `tawami`: run and resume driver scripts, draw results, check a weak form, show the set-up.

Wrong input gives one line and exit code 2, a run or check that fails gives exit code 1.
"""

from __future__ import annotations

import argparse
import importlib
import os
import shlex
import sys
from collections.abc import Callable, Sequence
from typing import Any

from tawami._rust import __version__
from tawami.base import checks
from tawami.base.errors import FormError, InputError, TawamiError
from tawami.command import new, trade
from tawami.command.folders import run_folder
from tawami.command.misuse import command_line, joined, unrecognised
from tawami.command.resume import resume
from tawami.command.script import INTERRUPTED, Script, start
from tawami.results.progress import LOG_LEVEL
from tawami.results.results import EXISTING

CODES = "Exit codes: 0 success; 1 the run or check failed; 2 wrong command line; 130 Ctrl-C; 143 SIGTERM"
LEVELS = ("debug", "info", "warning", "error")


def main(arguments: Sequence[str] | None = None) -> int:
    """Carry out a command and return the exit code.

    Args:
        arguments: By default those of the command line.
    """
    given = list(sys.argv[1:] if arguments is None else arguments)
    asked = _parsed(given)
    command: Callable[[argparse.Namespace], int] = asked.command
    try:
        code = command(asked)
        sys.stdout.flush()
        return code
    except TawamiError as error:
        print(f"{asked.name}: {error}", file=sys.stderr)
        return 2 if isinstance(error, InputError) else 1
    except KeyboardInterrupt:
        print(f"{asked.name}: interrupted", file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:  # | head
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1


def run() -> int:
    """As :func:`main`, for the command itself.

    After Ctrl-C the process ends at once: the processes of Open MPI received it too, and the end of MPI
    would wait for them.
    """
    code = main()
    if code == INTERRUPTED:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)
    return code


def _parsed(given: list[str]) -> argparse.Namespace:
    """Split the arguments of tawami from those of the script after --."""
    own, rest = given, list[str]()
    if "--" in given:
        own, rest = given[: given.index("--")], given[given.index("--") + 1 :]
    parser = _parser()
    if own and own[0].endswith(".py"):
        parser.error(f"'{own[0]}' is not a command: to run a script: {command_line('run', own[0])}")
    own = joined(own)
    asked, unknown = parser.parse_known_args(own)
    if asked.name == "tawami run" and asked.script is asked.module is None:
        asked.parser.error("expected a SCRIPT, or -m with the name of a module")
    if unknown or (asked.name == "tawami run" and asked.script and asked.module):
        asked.parser.error(unrecognised(asked, unknown, own))
    if rest and asked.name != "tawami run":
        parser.error(f"arguments after -- belong to a script: {asked.name} does not run one")
    asked.arguments = rest
    return asked


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="tawami",
        description="Implicit material point method with the mixed u-eps_v formulation: run driver "
        "scripts on one rank or several, resume them, draw their results.",
        epilog=f"tawami COMMAND --help describes a command. {CODES}.",
        allow_abbrev=False,
    )
    parser.add_argument("--version", action="version", version=f"tawami {__version__}")
    commands = parser.add_subparsers(title="commands", metavar="COMMAND", required=True)
    _add_run(commands)
    _add_resume(commands)
    _add_plot(commands)
    _add_new(commands)
    _add_trade(commands)
    _add_form(commands)
    _add(commands, "info", _info, "versions, BLAS, threads, missing packages, a self test", (
        "Shows the versions, the loaded BLAS, threads, memory, MPI, the compiler of forms and the "
        "folder of their kernels; missing packages and the commands that install them; and a self "
        "test: a small scene is compared with its closed form. Exit code 1 if they differ."
    ))  # fmt: skip
    return parser


def _add(
    commands: Any,
    name: str,
    command: Callable[[argparse.Namespace], int],
    short: str,
    description: str,
    *,
    under: str = "tawami",
    epilog: str | None = None,
) -> argparse.ArgumentParser:
    parser: argparse.ArgumentParser = commands.add_parser(
        name,
        help=short,
        description=description,
        epilog=epilog,
        allow_abbrev=False,
        formatter_class=argparse.RawDescriptionHelpFormatter if epilog else argparse.HelpFormatter,
    )
    parser.set_defaults(command=command, name=f"{under} {name}", parser=parser)
    return parser


def _add_run(commands: Any) -> None:
    run = _add(commands, "run", _run, "run a driver script, on one rank or several", (
        "Runs a script as python would. An error of tawami is printed as one line, others keep\n"
        "their traceback; on several ranks only the first one prints."
    ), epilog=(
        "examples:\n"
        "  tawami run pile.py\n"
        "  tawami run pile.py --ranks 4 --replace -- --friction 0.3\n"
        "  tawami run -m cases.showcase.collapse"
    ))  # fmt: skip
    run.add_argument("script", nargs="?", metavar="SCRIPT", help="a Python file")
    run.add_argument("-m", "--module", metavar="NAME", help="a module, as after python -m")
    _add_ranks(run)
    existing = run.add_mutually_exclusive_group()
    existing.add_argument(
        "--replace",
        dest="existing",
        action="store_const",
        const="replace",
        help="replace an earlier run in the folder of results",
    )
    existing.add_argument(
        "--resume",
        dest="existing",
        action="store_const",
        const="resume",
        help="resume an earlier run in the folder of results",
    )
    _add_log_level(run)


def _add_resume(commands: Any) -> None:
    parser = _add(commands, "resume", _resume, "resume an interrupted run", (
        "Runs the copy of the script in this folder, with the same arguments, in the same directory: "
        "finished phases are loaded, the interrupted phase continues from its newest checkpoint. "
        "This executes the script: resume only runs that you trust."
    ))  # fmt: skip
    parser.add_argument(
        "--trust",
        action="store_true",
        help="run the copy even if it differs from the script that started the run",
    )
    parser.add_argument("folder", metavar="FOLDER", help="folder of results, as results/pile")
    _add_ranks(parser)
    _add_log_level(parser)


def _add_plot(commands: Any) -> None:
    plot = _add(commands, "plot", _plot, "pictures and a movie of results", (
        "Draws the results of a run into its folder figures, and prints the names of the files."
    ))  # fmt: skip
    plot.add_argument(
        "folder", metavar="FOLDER", help="folder of results, as results/pile, or a file in it"
    )
    plot.add_argument(
        "--quantity",
        metavar="Q",
        help="colour (default: mean stress, or the first quantity written)",
    )
    plot.add_argument("--movie", choices=("gif", "mp4", "none"), default="gif", help="default: gif")


def _add_new(commands: Any) -> None:
    parser = _add(commands, "new", _new, "write a driver script", (
        "Writes NAME.py, a commented script that runs without changes. An existing file is not changed."
    ))  # fmt: skip
    parser.add_argument("file", metavar="NAME", help="as mycase, or folder/mycase.py")
    kind = parser.add_mutually_exclusive_group()
    for name, text in (("statics", "a beam, solved once (default)"), ("dynamics", "a slump")):
        kind.add_argument(
            f"--{name}", dest="kind", action="store_const", const=name, default="statics", help=text
        )


def _add_trade(commands: Any) -> None:
    trade.add_arguments(_add(commands, "trade", trade.run, "speed against accuracy of a script", (
        "Runs the function build of a script with the values of its knobs, and estimates the errors\n"
        "without a reference. Prints a table and writes it with a picture to results/trade/SCRIPT.\n"
        "Run again with a larger budget, the runs so far are kept."
    ), epilog=(
        "examples:\n"
        "  tawami trade beam.py --quantity tip --budget 60s\n"
        "  tawami trade beam.py --quantity tip --apply 0.5%"
    )))  # fmt: skip


def _add_form(commands: Any) -> None:
    form = commands.add_parser(
        "form", help="check a weak form", description="Commands for weak forms."
    )
    actions = form.add_subparsers(title="commands", metavar="COMMAND", required=True)
    check = _add(actions, "check", _form_check, "test a weak form", (
        "Loads a form and tests it: names, operators, units, symmetry, the tangent against differences\n"
        "at several dt, each field, rigid motions, patch tests, axisymmetry, both assemblies,\n"
        "stability and locking. Prints a table with the number and what to do in each line:\n"
        "pass; cost (exit code 0): a price or a limit; broken (exit code 1): it cannot be used."
    ), under="tawami form", epilog=(
        "examples:\n"
        "  tawami form check my_form.py\n"
        "  tawami form check u_epsv --set alpha=0.1 --set stabilisation=projection"
    ))  # fmt: skip
    check.add_argument("form", metavar="FORM", help="a file, or the name of a shipped form")
    check.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        dest="settings",
        help="a parameter or option of the form; may be repeated",
    )


def _add_ranks(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--ranks", type=_number_of_ranks, metavar="N", help="start N ranks with mpirun"
    )


def _add_log_level(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--log-level", choices=LEVELS, metavar="L", help=", ".join(LEVELS))


def _number_of_ranks(text: str) -> int:
    try:
        number = int(text)
    except ValueError:
        number = 0
    if number < 1:
        raise argparse.ArgumentTypeError(f"'{text}': expected a whole number, at least 1")
    processors = len(os.sched_getaffinity(0))
    most = max(16, 4 * processors)
    if number > most:
        raise argparse.ArgumentTypeError(
            f"{number} ranks on {processors} processors: expected at most {most}; start more with mpirun"
        )
    return number


def _environment(asked: argparse.Namespace) -> dict[str, str]:
    """Environment variables for the script."""
    level = {LOG_LEVEL: asked.log_level} if asked.log_level else {}
    existing = getattr(asked, "existing", None)
    return level | ({EXISTING: existing} if existing else {})


def _run(asked: argparse.Namespace) -> int:
    path = None if asked.script is None else checks.path("script", asked.script)
    script = Script(path, asked.module, tuple(asked.arguments))
    return start(script, asked.ranks, _environment(asked))


def _resume(asked: argparse.Namespace) -> int:
    return resume(run_folder(asked.folder), asked.ranks, _environment(asked), trust=asked.trust)


def _plot(asked: argparse.Namespace) -> int:
    plot = importlib.import_module("tawami.results.plot")  # here: it imports matplotlib
    movie = None if asked.movie == "none" else asked.movie
    for path in plot.plot(run_folder(asked.folder), quantity=asked.quantity, movie=movie):
        print(path)
    return 0


def _new(asked: argparse.Namespace) -> int:
    path = new.write(asked.file, asked.kind)
    print(f"{path} is written; run it with: tawami run {shlex.quote(str(path))}")
    return 0


def _form_check(asked: argparse.Namespace) -> int:
    from tawami.check.form_check import check_form
    from tawami.form.files import file_of

    settings = dict(map(_setting, asked.settings))
    try:
        file_of(asked.form)
    except FormError as error:
        raise InputError(str(error)) from error
    report = check_form(asked.form, **settings)
    print(report)
    return 0 if report.usable else 1


def _setting(text: str) -> tuple[str, Any]:
    name, equals, value = text.partition("=")
    if not (name and equals and value):
        raise InputError(f"--set {text}: expected NAME=VALUE, as alpha=0.1")
    try:
        return name, float(value)
    except ValueError:
        return name, value


def _info(_: argparse.Namespace) -> int:
    from tawami.command import information

    return information.show()
