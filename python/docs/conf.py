"""Sphinx settings for the pages that `python python/docs` puts together in results/docs/site."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Any

from docutils import nodes

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "python" / "docs"), str(ROOT)]

import sources  # noqa: E402  (it is found by the line above)

project = "tawami"
author = "The tawami developers"
project_copyright = author
extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.mathjax",
    "sphinx.ext.napoleon",
    "sphinx-mathjax-offline",
    "sphinx_design",
]
exclude_patterns = ["notebooks"]

# code of pages: the path of the cache is an option of the command line
nb_execution_mode = "cache"
nb_execution_in_temp = True
nb_execution_timeout = 600
nb_execution_show_tb = True
nb_merge_streams = True

# Markdown
myst_enable_extensions = ["dollarmath", "colon_fence", "deflist"]
myst_heading_anchors = 4
suppress_warnings: list[str] = []
math_number_all = False

# docstrings
default_role = "code"
autodoc_typehints = "none"
autodoc_member_order = "bysource"
autodoc_preserve_defaults = True
napoleon_google_docstring = True
napoleon_numpy_docstring = False
napoleon_use_ivar = True
napoleon_attr_annotations = False
napoleon_use_rtype = False
napoleon_custom_sections = ["History"]
python_maximum_signature_line_length = 88

# pages: nothing is loaded from the web
html_theme = "furo"
html_title = "tawami"
html_show_sphinx = False
html_copy_source = False
html_static_path = [str(ROOT / "python" / "docs" / "style")]
html_css_files = ["pages.css"]


def src(
    _name: str, rawtext: str, text: str, line: int, inliner: Any, *_: Any
) -> tuple[list[nodes.Node], list[nodes.system_message]]:
    """Role that links to a file of the repository and a symbol in it: {src}`forms/u.py residual`."""
    problem = sources.missing(text)
    if problem is not None:
        return [], [inliner.reporter.warning(problem, line=line)]
    env = inliner.document.settings.env
    page = Path(env.app.outdir, env.docname).parent
    target = sources.address(text, env.config.repository, page)
    name = nodes.literal(rawtext, text.replace(" ", ": ", 1), classes=["src"])
    return [nodes.reference(rawtext, "", name, refuri=target)], []


def plain_attributes(
    _app: Any, what: str, _name: str, _thing: Any, _opt: Any, lines: list[str]
) -> None:
    """Prepare docstrings: text before a colon, and all names of a list but the last, is not a type."""
    if what == "property":
        lines[0] = lines[0].replace(": ", "; ", 1)
    if "Attributes:" in lines:
        for k in range(lines.index("Attributes:") + 1, len(lines)):
            names, colon, text = lines[k].partition(": ")
            if re.fullmatch(r" {4}\w+(, \w+)+", names):
                lines[k] = names.replace(", ", ",\N{ZERO WIDTH SPACE}") + colon + text


def setup(app: Any) -> dict[str, bool]:
    """Register the role; draw equations as SVG, since browsers block fonts of local files."""
    app.add_role("src", src)
    app.add_config_value("own_code", Path(__file__).read_text(), "env")  # its changes count
    app.connect("autodoc-process-docstring", plain_attributes, priority=400)  # before napoleon
    app.add_config_value("repository", sources.repository(), "env")
    app.config.mathjax_path = "mathjax/tex-svg.js"
    mathjax = app.extensions["sphinx-mathjax-offline"]  # it copies files at the end only
    mathjax.parallel_read_safe = mathjax.parallel_write_safe = True
    return {"parallel_read_safe": True, "parallel_write_safe": True}
