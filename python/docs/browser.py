"""Open pages in headless Chromium: errors of the console, broken links, parts wider than the page."""

from __future__ import annotations

import shutil
from collections import defaultdict
from collections.abc import Iterable
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urldefrag, urlsplit

from executed import RunError

WIDTHS = (380, 900, 1400)  # of a phone, a tablet and a screen [pixels]
HEIGHT = 900
#: Root has no sandbox, and a throw-away root no /dev/shm.
OPTIONS = ("--no-sandbox", "--disable-dev-shm-usage")
#: Waits until equations are drawn.
DRAWN = "async () => { if (window.MathJax?.startup?.promise) await MathJax.startup.promise; }"
LINKS = "() => [...document.querySelectorAll('a[href]')].map(a => a.href)"
NAMES = "() => [...document.querySelectorAll('[id], a[name]')].map(e => e.id || e.name)"
MISTAKES = "() => [...document.querySelectorAll('mjx-merror, [data-mjx-error]')].map(e => e.title)"
#: An element that is wider than the page, if the page scrolls sideways.
WIDE = """() => {
    const width = document.documentElement.clientWidth;
    if (document.documentElement.scrollWidth <= width) return [];
    const scrolls = e => e && (getComputedStyle(e).overflowX != 'visible' || scrolls(e.parentElement));
    const parts = [...document.querySelectorAll('body *')]
        .filter(e => e.getBoundingClientRect().right > width + 1 && !scrolls(e.parentElement))
        .map(e => `<${e.tagName.toLowerCase()} class="${e.className}"> ${e.textContent.slice(0, 60)}`);
    return [parts[0] || 'the page'];
}"""


def problems(html: Path) -> list[str]:
    """Problems of all pages in a folder, each with the page.

    Raises:
        RunError: Chromium is not installed.
    """
    from playwright.sync_api import sync_playwright  # here, because `make test` does not install it

    found: list[str] = []
    names: dict[Path, set[str]] = {}
    links: dict[Path, list[str]] = {}
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium(), args=list(OPTIONS))
        tab = browser.new_page()
        said: list[str] = []
        tab.on(
            "console",
            lambda message: said.append(message.text) if message.type == "error" else None,
        )
        tab.on("pageerror", lambda error: said.append(str(error)))
        tab.on("requestfailed", lambda request: said.append(f"{request.url} cannot be loaded"))
        for page in sorted(html.rglob("*.html")):
            said.clear()
            tab.goto(page.as_uri())
            tab.evaluate(DRAWN)
            names[page], links[page] = set(tab.evaluate(NAMES)), tab.evaluate(LINKS)
            said += [f"an equation is wrong: {title}" for title in tab.evaluate(MISTAKES)]
            said += _wide(tab)
            found += [f"{page.relative_to(html)}: {text}" for text in said]
        browser.close()
    return found + [f"{page.relative_to(html)}: {link}" for page, link in broken(links, names)]


def chromium() -> str:
    """Path of the browser.

    Raises:
        RunError: It is not installed.
    """
    path = shutil.which("chromium")
    if path is None:
        raise RunError(
            "chromium, which opens every page, was not found: run `make docs`, which installs it"
        )
    return path


def _wide(tab: Any) -> list[str]:
    """Parts that make a page scroll sideways."""
    found = []
    for width in WIDTHS:
        tab.set_viewport_size({"width": width, "height": HEIGHT})
        found += [f"is wider than {width} pixels: {part}" for part in tab.evaluate(WIDE)]
    return found


def broken(links: dict[Path, list[str]], names: dict[Path, set[str]]) -> Iterable[tuple[Path, str]]:
    """Links to files that do not exist, and to places that a page does not have, with their page."""
    missing = defaultdict(set)
    for page, targets in links.items():
        for target in targets:
            address, place = urldefrag(target)
            if urlsplit(address).scheme != "file":
                continue
            file = Path(unquote(urlsplit(address).path))
            if not file.exists():
                missing[page].add(f"links to {file}, which does not exist")
            elif place and file in names and unquote(place) not in names[file]:
                missing[page].add(f"links to {file.name}#{place}, and the page has no such place")
    return [(page, text) for page, texts in missing.items() for text in sorted(texts)]


def photograph(html: Path, names: Iterable[str], target: Path) -> None:
    """Write pictures of pages at each width: NAME-WIDTH.png."""
    from playwright.sync_api import sync_playwright

    target.mkdir(parents=True, exist_ok=True)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium(), args=list(OPTIONS))
        tab = browser.new_page()
        for name in names:
            tab.goto((html / f"{name}.html").as_uri())
            for width in WIDTHS:
                tab.set_viewport_size({"width": width, "height": HEIGHT})
                tab.evaluate(DRAWN)
                file = target / f"{name.replace('/', '-')}-{width}.png"
                tab.screenshot(path=file, full_page=True)
        browser.close()
