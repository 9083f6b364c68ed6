"""Sphinx: equations as MathML, which browsers draw without a network, and the role `src`.

docutils turns LaTeX into MathML by itself; what it does not know is a warning, and so an error of
`make docs`.
"""

from __future__ import annotations

from typing import Any

import sources
from docutils import nodes
from docutils.utils.math import MathError
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.application import Sphinx
from sphinx.util import logging
from sphinx.util.math import get_node_equation_number

LOGGER = logging.getLogger(__name__)


def _markup(node: nodes.Node, *, block: bool) -> str:
    """MathML of an equation."""
    try:
        return str(tex2mathml(node.astext(), as_block=block))
    except MathError as error:
        LOGGER.warning("equation %r: %s", node.astext(), error, location=node)
        return f"<code>{node.astext()}</code>"


def visit_math(writer: Any, node: nodes.math) -> None:
    """An equation in the text."""
    writer.body.append(_markup(node, block=False))
    raise nodes.SkipNode


def visit_math_block(writer: Any, node: nodes.math_block) -> None:
    """An equation by itself, with its number."""
    writer.body.append(writer.starttag(node, "div", CLASS="math"))
    if node["number"]:
        writer.body.append(f'<span class="eqno">({get_node_equation_number(writer, node)})')
        writer.add_permalink_ref(node, "Link to this equation")
        writer.body.append("</span>")
    writer.body.append(_markup(node, block=True) + "</div>\n")
    raise nodes.SkipNode


def src(
    _name: str, rawtext: str, text: str, line: int, inliner: Any, *_: Any
) -> tuple[list[nodes.Node], list[nodes.system_message]]:
    """A file of the repository, and a symbol in it: {src}`forms/u.py residual`."""
    problem = sources.missing(text)
    if problem is not None:
        return [], [inliner.reporter.warning(problem, line=line)]
    return [nodes.literal(rawtext, text.replace(" ", ": ", 1), classes=["src"])], []


def setup(app: Sphinx) -> dict[str, bool]:
    """As Sphinx calls it."""
    app.add_html_math_renderer("mathml", (visit_math, None), (visit_math_block, None))
    app.add_role("src", src)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
