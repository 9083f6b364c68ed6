"""Build the site: assemble the pages in results/docs and convert them to results/docs/html.

python python/docs [--links]

Pages are copied. Names in double braces are replaced by generated text, and code marked `{run}` is run
(`executed`). Warnings are errors, and so is a page that loads something from the web.
"""

from __future__ import annotations

import argparse
import contextlib
import sys
from pathlib import Path
from time import perf_counter

import executed
import pages
from sphinx.cmd.build import main as sphinx


def build(links: bool) -> int:
    """Assemble the pages and run Sphinx; return the exit code."""
    start = perf_counter()
    try:
        names = pages.assemble(executed.RESULTS)
    except executed.RunError as error:
        print(f"docs: {error}", file=sys.stderr)
        return 1
    source = str(executed.RESULTS)
    options = ["-W", "--keep-going", "-q", "-c", str(Path(__file__).parent)]
    options += ["-d", f"{source}/doctrees", source]
    code = sphinx(["-b", "html", *options, f"{source}/html"])
    for reference in pages.loaded_from_web(executed.RESULTS / "html"):
        print(f"docs: {reference} would be loaded from the web", file=sys.stderr)
        code = 1
    if code == 0 and links:
        code = sphinx(["-b", "linkcheck", *options, f"{source}/links"])
    minutes = (perf_counter() - start) / 60
    print(f"{len(names)} pages in {minutes:.1f} min: {source}/html/index.html")
    return int(code)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(prog="python python/docs", description=__doc__)
    parser.add_argument("--links", action="store_true", help="also check links to the web")
    with contextlib.suppress(KeyboardInterrupt):
        sys.exit(build(parser.parse_args().links))
    sys.exit(130)
