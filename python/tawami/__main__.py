"""`python -m tawami` is `tawami`."""

import sys

from tawami.command_line import main

sys.exit(main())
