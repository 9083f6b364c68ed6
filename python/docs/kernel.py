"""Prepare the IPython kernel that runs the code of pages; a profile of `notebooks` runs it at the start.

Errors and warnings are shown as one line, as `tawami.run` prints them, and without the paths of this
machine.
"""

import logging
import warnings

from IPython import get_ipython


def _prepare():
    def one_line(kind, error, *_, **__):
        return [f"{kind.__name__}: {error}"]

    def show(message, category, *_, **__):
        print(f"{category.__name__}: {message}")

    get_ipython().InteractiveTB.structured_traceback = one_line
    warnings.showwarning = show
    logging.disable(logging.INFO)  # compiling forms logs much


_prepare()
del _prepare
