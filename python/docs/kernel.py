"""Prepare the IPython kernel that runs the code of pages; a profile of `notebooks` runs it at the start.

Errors and warnings are shown by their class and message, without the code and paths of this machine.
"""

import logging
import textwrap
import warnings

import matplotlib
from IPython import get_ipython

from tawami.base import line
from tawami.picture import style


def _prepare():
    def lines(kind, text):
        return textwrap.fill(f"{kind.__name__}: {text}", 94, subsequent_indent="    ")

    def brief(kind, error, *_, **__):
        return [lines(kind, error)]

    def show(message, category, *_, **__):
        print(lines(category, message))

    get_ipython().InteractiveTB.structured_traceback = brief
    warnings.showwarning = show
    matplotlib.rcParams.update(style.PARAMETERS)  # as in the figures of the package
    logging.disable(logging.INFO)  # compiling forms logs much
    line.in_notebook = lambda: False  # no bars of progress in pages


_prepare()
del _prepare
