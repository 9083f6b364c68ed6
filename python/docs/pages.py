"""Pages of the site: copies of the Markdown files, with code run and generated parts inserted."""

from __future__ import annotations

import csv
import importlib
import inspect
import json
import os
import re
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from time import perf_counter
from urllib.parse import urlsplit

import compatibility
import executed
import messages
from sources import ROOT

from tawami.base import errors, program

SOURCE = Path(__file__).parent
#: Cases: title, folder of `cases/`, and the modules that state the problem, besides the one that runs.
CASES: dict[str, tuple[str, str, tuple[str, ...]]] = {
    "cantilever": ("Cantilever", "verification", ("beam",)),
    "cook": ("Cook's membrane", "verification", ("membrane",)),
    "cut_cells": ("Cut cells", "showcase", ()),
    "one_line": ("One line of the weak form", "showcase", ()),
    "self_weight": ("Self-weight", "verification", ()),
    "elastica": ("Elastica", "verification", ("strip",)),
    "footing": ("Footing", "verification", ()),
    "bearing_capacity": ("Bearing capacity", "verification", ()),
    "dilatancy": ("Dilatancy", "verification", ("block", "enumeration")),
    "vibrating_beam": ("Vibrating beam", "verification", ("beam",)),
    "spinning_disc": ("Spinning disc", "verification", ("disc",)),
    "collapse": ("Collapse", "showcase", ("pile",)),
    "projection": ("Nodal projection", "costs", ()),
    "ordering": ("Orderings of MUMPS", "costs", ()),
    "writing": ("Writing results", "costs", ()),
}
TRADE = ("cantilever", "cook", "collapse", "self_weight", "spinning_disc")
LINK = re.compile(r"https?://[^\s)>\"'`]+")
#: Elements of HTML that a browser loads with the page.
LOADED = re.compile(
    r"<(?:script|img|iframe|link [^>]*stylesheet)[^>]*(?:src|href)=[\"']((?:https?:)?//[^\"']+)"
)


def assemble(target: Path) -> list[str]:
    """Write all pages to a folder.

    Raises:
        executed.RunError: Code or a case on a page failed, or a link is not well-formed.
    """
    texts = {f"cases/{name}": case_page(name) for name in CASES}
    for path in sorted(SOURCE.rglob("*.md")):
        name = str(path.relative_to(SOURCE).with_suffix(""))
        texts[name] = complete(name, path.read_text())
    for name, text in texts.items():
        _check_links(name, text)
        _write(target / f"{name}.md", text)
    for old in [*target.glob("*.md"), *target.glob("cases/*.md")]:
        if str(old.relative_to(target).with_suffix("")) not in texts:
            old.unlink()
    for picture in [*ROOT.glob("cases/costs/trade/*.png"), ROOT / "cases/extremes/map.png"]:
        copy = target / picture.parent.name / picture.name
        copy.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(picture, copy)
    return list(texts)


def _write(path: Path, text: str) -> None:
    """Write a file if it changes: Sphinx reads files that are newer."""
    if not path.exists() or path.read_text() != text:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)


def _check_links(name: str, text: str) -> None:
    for link in LINK.findall(text):
        parts = urlsplit(link)
        if not re.fullmatch(r"[\w-]+(\.[\w-]+)+", parts.hostname or ""):
            raise executed.RunError(f"{name}.md: the link {link} is not well-formed")


def loaded_from_web(html: Path) -> list[str]:
    """Addresses that pages would load from the web when they are viewed, with the page."""
    return [
        f"{page.name}: {address}"
        for page in sorted(html.rglob("*.html"))
        for address in LOADED.findall(page.read_text())
    ]


def complete(name: str, text: str) -> str:
    """A page with its code run and its generated parts inserted."""
    text = executed.blocks(name, text)
    return re.sub(r"^\{\{(.+)\}\}$|\{\{(.+?)\}\}", _generated, text, flags=re.MULTILINE)


def _generated(match: re.Match[str]) -> str:
    return GENERATED[match[1] or match[2]]()


def exists(dotted: str) -> bool:
    """Whether a module or an attribute of that name exists."""
    module, _, attribute = dotted.rpartition(".")
    try:
        importlib.import_module(dotted)
        return True
    except ImportError:
        pass
    parts = module.split(".")
    for end in range(len(parts), 0, -1):
        try:
            found: object = importlib.import_module(".".join(parts[:end]))
        except ImportError:
            continue
        for part in parts[end:]:
            found = getattr(found, part, None)
        return hasattr(found, attribute)
    return False


# -- cases -------------------------------------------------------------------


def case_page(name: str) -> str:
    """Page of a case: its description, its pictures and its output."""
    title, room, beside = CASES[name]
    output = executed.case(room, name)
    folder = ROOT / "cases" / room / name
    if folder.is_dir():
        files = [*(folder / f"{module}.py" for module in beside), folder / "__main__.py"]
    else:
        files = [folder.with_suffix(".py")]
    about = "\n\n".join(_docstring(file) for file in files)
    named = ", ".join(f"{{src}}`{file.relative_to(ROOT)}`" for file in files)
    options = executed.SHORTER.get(name, ())
    command = " ".join(["python -m", f"cases.{room}.{name}", *options])
    shorter = " Without the option it takes a few times as long." if options else ""
    pictures = "\n\n".join(
        f"![{title}: {path.stem.replace('_', ' ')}]({name}/{path.name})" for path in output.pictures
    )
    return (
        f"# {title}\n\n`{command}`, {_duration(output.seconds)}; {named}.{shorter}\n\n"
        f"````text\n{about}\n````\n\n{pictures}\n\n"
        f"## Output\n\n````text\n{output.text.strip()}\n````\n"
    )


def _docstring(file: Path) -> str:
    text = re.match(r'"""(.*?)"""', file.read_text(), flags=re.DOTALL)
    assert text is not None, file
    return inspect.cleandoc(text[1])


def _duration(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 90 else f"{seconds / 60:.1f} min"


# -- generated parts ---------------------------------------------------------


def _trade() -> str:
    sections = []
    for name in TRADE:
        text = (ROOT / "cases" / "costs" / "trade" / f"{name}.md").read_text()
        words = text.partition("\n")[2].strip()
        title = CASES[name][0]
        picture = f"![{title}: errors over wall time](trade/{name}.png)"
        sections.append(f"## {title}\n\n{picture}\n\n{_paragraphs(words)}")
    return "\n\n".join(sections)


def _paragraphs(words: str) -> str:
    return "\n\n".join(messages.plain(part) for part in words.split("\n\n"))


def _compatibility() -> str:
    """The tables, of the last run if nothing has changed."""
    patterns = (*executed.SHARED, "python/docs/compatibility.py")
    folder = executed.RESULTS / "executed" / "compatibility"
    return executed.cached(folder, executed.fingerprint(patterns), _try_all).text


def _try_all() -> str:
    cells: list[compatibility.Cell] = []
    seconds: dict[int, float] = {}
    for number in (1, 2):
        words, environment = [sys.executable, str(SOURCE / "compatibility.py")], dict(os.environ)
        if number > 1:
            words, environment = program.mpirun(number, words)
        start = perf_counter()
        what = f"compatibility, ranks: {number}"
        text = executed.command(words, ROOT, what, environment)
        seconds[number] = perf_counter() - start
        for row in json.loads(text):
            cells.append(compatibility.Cell(**row | {"numbers": tuple(row["numbers"])}))
    return compatibility.page(cells, seconds)


def _peers() -> str:
    """Errors of deflection and mean stress of the cantilever, by formulation."""
    with open(executed.RESULTS / "cases" / "cantilever" / "cantilever.csv") as file:
        rows = [row for row in csv.DictReader(file) if row["support"] == "exact"]
    methods = {
        "displacement only": ("u", ""),
        "B-bar": ("u_bbar", ""),
        "u-ε_v, $\\alpha$ = 0": ("u_epsv", "0.0"),
        "u-ε_v, $\\alpha$ = 0.1": ("u_epsv", "0.1"),
    }
    cells = sorted({int(row["n"]) for row in rows if row["method"] == "u"})
    error = {(row["method"], row["alpha"], int(row["n"])): row for row in rows}
    lines = ["| formulation | " + " | ".join(f"{n} cells" for n in cells) + " |"]
    lines.append("|" + " --- |" * (1 + len(cells)))
    for what, key in (("deflection", "error_percent"), ("mean stress", "mean_stress_l2")):
        best = {n: abs(float(error["u_epsv", "0.1", n][key])) for n in cells}
        for title, (method, alpha) in methods.items():
            entries = []
            for n in cells:
                value = abs(float(error[method, alpha, n][key]))
                percent = value if key == "error_percent" else 100 * value
                digits = f"{percent:.0f}" if percent > 99 else f"{percent:.2g}"
                entries.append(f"{digits} % ({value / best[n]:.2g})")
            lines.append(f"| {what}: {title} | " + " | ".join(entries) + " |")
    return "\n".join(lines)


def _sizes() -> str:
    """Lines and characters of the mixed forms."""
    texts = [(ROOT / "forms" / f"{name}.py").read_text() for name in ("u_epsv", "u_p")]
    return " and ".join(f"{len(t.splitlines())} lines ({len(t)} characters)" for t in texts)


def _classes() -> str:
    """Table of exceptions and warnings with base class and description."""
    lines = ["| class | is a | when |", "| --- | --- | --- |"]
    for name in sorted(errors.__all__, key=lambda name: (name.endswith("Warning"), name)):
        kind = getattr(errors, name)
        parents = ", ".join(f"`{base.__name__}`" for base in kind.__bases__)
        says = inspect.cleandoc(kind.__doc__ or "").partition("\n\n")[0]
        says = messages.plain(says).replace("\\`", "`")
        lines.append(f"| `{name}` | {parents} | {says} |")
    return "\n".join(lines)


GENERATED: dict[str, Callable[[], str]] = {
    "trade": _trade,
    "compatibility": _compatibility,
    "peers": _peers,
    "form sizes": _sizes,
    "classes": _classes,
    "messages": messages.listing,
}
