"""Pages with code: notebooks in MyST Markdown, which MyST-NB runs and keeps in a cache.

The cache belongs to the sources of the package: after a change of these all code is run again. A cell
with the tags `raises-exception` and the name of an error must raise this error.
"""

from __future__ import annotations

import os
import re
import shutil
from pathlib import Path

import executed

CACHES = executed.RESULTS / "cache"
#: Files that the code of pages reads.
READ = (*executed.SHARED, "cases/**/*.py", "cases/**/*.csv", "python/docs/kernel.py")
#: A cell of a page that may raise an error, and the errors shown in it.
CELL = re.compile(
    r'<div class="cell ([^"]*tag_raises-exception[^"]*)">(.*?)(?=<div class="cell |</article>|\Z)',
    flags=re.DOTALL,
)
RAISED = re.compile(
    r'<div class="output traceback[^>]*>.*?<pre>(?:<span></span>)?(\w+):', flags=re.DOTALL
)
#: Roles of Sphinx in text, with an optional title before the target.
ROLE = re.compile(r"\{\w+\}`(?:([^`<]*?) *<[^`>]*>|([^`]*))`")


def prepare() -> Path:
    """Set the environment of the kernels.

    Returns:
        Folder of the cache for the present sources; caches of earlier ones are deleted.
    """
    profile = executed.RESULTS / "ipython" / "profile_default" / "startup"
    profile.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(Path(__file__).with_name("kernel.py"), profile / "kernel.py")
    # warnings of the kernel itself, about its connection, are not for readers of the log
    quiet = "get_config().IPKernelApp.log_level = 40\n"
    (profile.parent / "ipython_kernel_config.py").write_text(quiet)
    os.environ["IPYTHONDIR"] = str(profile.parents[1])
    os.environ["PYTHONPATH"] = executed.search_path()
    os.environ.pop("MPLBACKEND", None)  # the kernel's own shows figures in the page
    cache = CACHES / executed.fingerprint(READ)[:16]
    for old in CACHES.glob("*"):
        if old != cache:
            shutil.rmtree(old)
    return cache


def problems(html: Path) -> list[str]:
    """Cells of built pages that raised another error than their tags name."""
    found = []
    for page in sorted(html.rglob("*.html")):
        for classes, shown in CELL.findall(page.read_text()):
            tags = [name.removeprefix("tag_") for name in classes.split() if "tag_" in name]
            expected = [tag for tag in tags if tag != "raises-exception"]
            raised = RAISED.findall(shown)
            if raised != expected:
                found.append(
                    f"{page.relative_to(html)}: a cell raised {' '.join(raised) or 'nothing'}: expected "
                    f"the one error that its tags name, {expected}"
                )
    return found


def download(text: str) -> str:
    """The notebook of a page as JSON, to be run where tawami is installed: code and text only."""
    import nbformat
    from myst_nb.core.read import read_myst_markdown_notebook

    notebook = read_myst_markdown_notebook(text)
    for number, cell in enumerate(notebook.cells):
        cell.id = f"cell-{number}"  # random by default
        if cell.cell_type == "markdown":
            cell.source = ROLE.sub(lambda match: f"`{match[1] or match[2]}`", cell.source)
    nbformat.validate(notebook)
    return nbformat.writes(notebook) + "\n"
