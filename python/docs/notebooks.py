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
    os.environ["IPYTHONDIR"] = str(profile.parents[1])
    os.environ["PYTHONPATH"] = executed.search_path()
    os.environ.pop("MPLBACKEND", None)  # the kernel's own shows figures in the page
    cache = CACHES / executed.fingerprint(READ)[:16]
    for old in CACHES.glob("*"):
        if old != cache:
            shutil.rmtree(old)
    return cache


def problems(folder: Path) -> list[str]:
    """Cells of executed notebooks that raised another error than their tags name."""
    import nbformat  # here, because `make test` does not install it

    found = []
    for path in sorted(folder.rglob("*.ipynb")):
        for cell in nbformat.read(path, as_version=4).cells:
            tags = cell.metadata.get("tags", [])
            if cell.cell_type != "code" or "raises-exception" not in tags:
                continue
            expected = [tag for tag in tags if tag != "raises-exception"]
            raised = [o.ename for o in cell.outputs if o.output_type == "error"]
            if raised != expected:
                place = path.relative_to(folder).with_suffix("")
                found.append(
                    f"{place}: a cell raised {' '.join(raised) or 'nothing'}: expected the one "
                    f"error that its tags name, {expected}:\n{cell.source}"
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
