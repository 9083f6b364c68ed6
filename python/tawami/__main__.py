"""`python -m tawami` is `tawami`."""

import sys

from tawami.command_line import run

sys.exit(run())
