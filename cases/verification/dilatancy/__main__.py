"""Why the field of the mixed form is the elastic volumetric strain.

1. A block is pressed on a rough base, for angles of dilation up to that of friction and Poisson's
   ratios up to 0.4999 (`block.py`). All runs converge, in 4 to 5 iterations per step.
2. The rate problem of a small patch on the verge of yield is stated with the total and with the elastic
   volumetric strain as field (`enumeration.py`). Each candidate is plastic or not, so that all active
   sets can be solved. A set is consistent if its plastic particles flow forward and its elastic ones
   stay within the yield surface. Without a consistent set there is no solution.

With the total strain 40 states out of 40 have one consistent set at nu = 0.3 and 0.45. At nu = 0.49, 11
have none and 12 have several. With the elastic strain every state has exactly one at every nu.

python -m cases.verification.dilatancy
"""

from __future__ import annotations

from collections.abc import Sequence

from cases.common.program import Program
from cases.common.table import as_csv, as_text
from cases.verification.dilatancy import block, enumeration

PROGRAM = Program("cases.verification.dilatancy", __doc__)


def main(arguments: Sequence[str] | None = None) -> None:
    """Print and write the tables."""
    PROGRAM.start(arguments)
    counts = enumeration.study()
    print(as_text(counts, enumeration.COLUMNS))
    PROGRAM.write("enumeration.csv", as_csv(counts, enumeration.COLUMNS))
    runs = block.study()
    print(as_text(runs, block.COLUMNS))
    PROGRAM.write("block.csv", as_csv(runs, block.COLUMNS))
    PROGRAM.list_results()


if __name__ == "__main__":
    PROGRAM.run(main)
