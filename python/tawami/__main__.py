"""`python -m tawami` is `tawami`."""

import sys

from tawami.command.main import run

sys.exit(run())
