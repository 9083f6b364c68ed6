"""The program around a case: arguments, header, results folder, progress bar.

PROGRAM = Program("cases.verification.cook", __doc__)
PROGRAM.option("--turns", type=int, default=10, help="number of turns")

def main(arguments=None):
    options = PROGRAM.start(arguments)
    ...
    PROGRAM.list_results()

if __name__ == "__main__":
    PROGRAM.run(main)
"""

from __future__ import annotations

import argparse
import logging
import sys
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, TypeVar

from mpi4py import MPI

import tawami
from tawami.base.files import atomic_file, result_folder
from tawami.base.line import in_notebook, progress_bar
from tawami.fem.environment import header

T = TypeVar("T", int, float)


class Program:
    """The command line of a case.

    Args:
        module: Name of the case's module, as after `python -m`.
        description: Text that `--help` prints.
        files: Whether the case writes files: adds the option `--results`.

    Attributes:
        folder: Folder of the results; exists after `start`.
    """

    def __init__(self, module: str, description: str | None, *, files: bool = True) -> None:
        self.name = module.rpartition(".")[2]
        self.folder = Path("results") / self.name
        self._files = files
        self._parser = argparse.ArgumentParser(
            prog=f"python -m {module}",
            description=description,
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        if files:
            text = f"folder of the results, {self.folder} by default"
            self.option("--results", type=Path, default=self.folder, metavar="FOLDER", help=text)

    def option(self, *names: str, **settings: Any) -> None:
        """Declare an option, with the arguments of `argparse`'s `add_argument`."""
        self._parser.add_argument(*names, **settings)

    def start(self, arguments: Sequence[str] | None = None) -> argparse.Namespace:
        """Parse the arguments, print the versions, create the results folder.

        Args:
            arguments: Those of the command line by default.

        Raises:
            OutputError: The folder cannot be written.
        """
        options = self._parser.parse_args(arguments)
        import matplotlib  # here, because modules of a case are imported without its program too

        matplotlib.use("Agg")
        logging.disable(logging.INFO)  # compiling a form logs many lines
        print(header(), flush=True)
        if self._files:
            self.folder = result_folder(options.results)
        return options

    def error(self, message: str) -> None:
        """Print the usage and a message, and exit with code 2."""
        self._parser.error(message)

    def write(self, name: str, text: str) -> None:
        """Write a text file to the results folder, on the first rank."""
        if MPI.COMM_WORLD.rank == 0:
            with atomic_file(self.folder / name) as part:
                part.write_text(text)

    def list_results(self) -> None:
        """Print the files of the results folder."""
        print(f"\nResults in {self.folder}:")
        for path in sorted(self.folder.iterdir()):
            if not path.name.startswith("."):
                print(f"  {path}")

    def run(self, main: Callable[[], None]) -> None:
        """Run `main`. An error of tawami is printed as one line and ends all ranks."""
        tawami.run(main, self.name)


def progress(items: Iterable[Any] | None = None, **options: Any) -> Any:
    """A `tqdm` bar over items; shown by the first rank, and in a terminal or a notebook only."""
    shown = MPI.COMM_WORLD.rank == 0 and (sys.stderr.isatty() or in_notebook())
    return progress_bar(items, disable=not shown, **options)


def numbers(kind: type[T], valid: Callable[[T], bool], expected: str) -> Callable[[str], list[T]]:
    """The type of an argument that is a list of numbers, such as 2,4,8.

    Args:
        kind: Type of each number.
        valid: Whether a number is in its range.
        expected: Expected value, for the error message.
    """

    def parse(text: str) -> list[T]:
        try:
            values = [kind(part) for part in text.split(",")]
        except ValueError:
            values = []
        if not values or not all(valid(value) for value in values):
            raise argparse.ArgumentTypeError(f"{text}: expected {expected}")
        return values

    return parse
