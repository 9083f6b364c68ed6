"""Build the site: assemble the pages in results/docs/site and convert them to results/docs/html.

python python/docs [--page NAME] [--screens] [--links] [--thumbnails]

Pages are copied, and names in double braces are replaced by generated text. MyST-NB runs the code of
pages (`notebooks`). Warnings are errors, and so are problems that headless Chromium finds (`browser`),
and pages that load something from the web. With --page only one page is built, in a folder of its own,
and its links to other pages are not checked. --screens writes a picture of each page at each width to
results/docs/screens. --thumbnails draws the pictures of README's gallery from the figures of the cases,
and builds nothing.
"""

from __future__ import annotations

import argparse
import contextlib
import shutil
import sys
from pathlib import Path
from time import perf_counter

import browser
import executed
import notebooks
import pages
import thumbnails
from sphinx.cmd.build import main as sphinx


def build(page: str | None, *, links: bool, screens: bool) -> int:
    """Assemble the pages and run Sphinx; return the exit code."""
    start = perf_counter()
    folder = executed.RESULTS
    if page is not None:
        folder = folder / "pages" / page.replace("/", "-")
    source, html, doctrees = folder / "site", folder / "html", folder / "doctrees"
    try:
        names = pages.assemble(source, page)
    except executed.RunError as error:
        print(f"docs: {error}", file=sys.stderr)
        return 1
    options = ["-q", "-c", str(Path(__file__).parent), "-j", str(executed.workers())]
    options += ["-D", f"nb_execution_cache_path={notebooks.prepare()}", "-d", str(doctrees)]
    if page is None:
        options += ["-W", "--keep-going"]
    else:
        options += ["-D", f"root_doc={page}", "-D", "suppress_warnings=ref,myst.xref_missing,toc"]
    code = sphinx(["-b", "html", *options, str(source), str(html)])
    problems = [*pages.problems(html), *notebooks.problems(folder / "jupyter_execute")]
    problems += browser.problems(html)
    for problem in problems:
        print(f"docs: {problem}", file=sys.stderr)
    if screens:
        browser.photograph(html, names, folder / "screens")
    code = int(bool(code or problems))
    if code == 0 and links:
        code = sphinx(["-b", "linkcheck", *options, str(source), str(folder / "links")])
    if code:
        shutil.rmtree(doctrees)  # so that warnings are repeated by the next build
    minutes = (perf_counter() - start) / 60
    print(f"{len(names)} pages in {minutes:.1f} min: {html}/{page or 'index'}.html")
    return int(code)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(prog="python python/docs", description=__doc__)
    parser.add_argument("--page", metavar="NAME", help="build this page only, such as start")
    parser.add_argument("--links", action="store_true", help="also check links to the web")
    parser.add_argument("--screens", action="store_true", help="write a picture of each page")
    parser.add_argument("--thumbnails", action="store_true", help="draw README's gallery")
    given = parser.parse_args()
    with contextlib.suppress(KeyboardInterrupt):
        if given.thumbnails:
            pages.draw_thumbnails(pages.SOURCE / "pictures" / "thumbnails", thumbnails.README)
            sys.exit()
        sys.exit(build(given.page, links=given.links, screens=given.screens))
    sys.exit(130)
