"""Sphinx for the pages that `python python/docs` has put together in results/docs."""

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "python" / "docs"), str(ROOT)]

project = "tawami"
author = "The tawami developers"
project_copyright = author
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "mathml"]
exclude_patterns = ["html", "doctrees", "generated", "cases/*/**", "executed"]

# Markdown
myst_enable_extensions = ["dollarmath", "colon_fence", "deflist"]
myst_heading_anchors = 4
suppress_warnings: list[str] = []
math_number_all = False
html_math_renderer = "mathml"

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

# pages: nothing is loaded from elsewhere
html_theme = "furo"
html_title = "tawami"
html_show_sphinx = False
html_copy_source = False
html_static_path = [str(ROOT / "python" / "docs" / "style")]
html_css_files = ["pages.css"]
