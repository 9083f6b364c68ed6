"""The site: pages are put together in results/docs and made into results/docs/html.

python python/docs [--links]

Pages are copied; what stands in double braces is generated, and code marked `{run}` is run
(`executed`). Warnings are errors.
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
    """Put the pages together and run Sphinx; its exit code."""
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
    if code == 0 and links:
        code = sphinx(["-b", "linkcheck", *options, f"{source}/links"])
    minutes = (perf_counter() - start) / 60
    print(f"{len(names)} pages in {minutes:.1f} min: {source}/html/index.html")
    return int(code)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(prog="python python/docs", description=__doc__)
    parser.add_argument("--links", action="store_true", help="check links to the web too")
    with contextlib.suppress(KeyboardInterrupt):
        sys.exit(build(parser.parse_args().links))
    sys.exit(130)
