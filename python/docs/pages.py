"""Pages of the site: copies of the Markdown files with generated parts, and a page for each case."""

from __future__ import annotations

import csv
import importlib
import inspect
import json
import os
import re
import shutil
import sys
import textwrap
from collections.abc import Callable, Iterable
from itertools import groupby
from pathlib import Path
from time import perf_counter
from urllib.parse import urlsplit

import compatibility
import executed
import messages
import notebooks
import thumbnails
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
    "consolidation": ("Consolidation", "verification", ()),
    "soft_clay": ("Soft clay", "verification", ()),
    "heated_wall": ("Heated wall", "verification", ()),
    "creep": ("Creep", "verification", ()),
    "fracture": ("Fracture", "verification", ()),
    "ring": ("Ring", "verification", ()),
    "effectivity": ("Estimated errors", "verification", ()),
    "elastica": ("Elastica", "verification", ("strip",)),
    "footing": ("Footing", "verification", ()),
    "rigid_footing": ("Rigid footing", "verification", ("footing",)),
    "bearing_capacity": ("Bearing capacity", "verification", ()),
    "circular_footing": ("Circular footing", "verification", ()),
    "dilatancy": ("Dilatancy", "verification", ("block", "enumeration")),
    "vibrating_beam": ("Vibrating beam", "verification", ("beam",)),
    "spinning_disc": ("Spinning disc", "verification", ("disc",)),
    "penetration": ("Penetration", "verification", ()),
    "rolling": ("Rolling disc", "verification", ()),
    "collapse": ("Collapse", "showcase", ("pile",)),
    "projection": ("Nodal projection", "costs", ()),
    "ordering": ("Orderings of MUMPS", "costs", ()),
    "contact": ("Steps into contact", "costs", ()),
    "solvers": ("Linear solvers", "costs", ()),
    "preconditioners": ("Variants of multigrid", "costs", ()),
    "memory_per_rank": ("Memory of a rank", "costs", ()),
    "balance": ("Division of the particles among the ranks", "costs", ()),
    "writing": ("Writing results", "costs", ()),
}
#: Pages that can be downloaded as notebooks.
TUTORIALS = ("start", "slope", "collapse", "edit_a_form", "add_a_law", "cam_clay", "ranks")
TRADE = (
    "cantilever", "cook", "ring", "consolidation", "penetration", "collapse", "self_weight",
    "spinning_disc",
)  # fmt: skip
LINK = re.compile(r"https?://[^\s)>\"'`]+")
#: Elements of HTML that a browser loads with the page.
LOADED = re.compile(
    r"<(?:script|img|iframe|link [^>]*stylesheet)[^>]*(?:src|href)=[\"']((?:https?:)?//[^\"']+)"
)


def assemble(target: Path, only: str | None = None) -> list[str]:
    """Write all pages, or one, to a folder; return their names.

    Raises:
        executed.RunError: A case failed, a link is not well-formed, or there is no page of that name.
    """
    sources = {str(p.relative_to(SOURCE).with_suffix("")): p for p in sorted(SOURCE.rglob("*.md"))}
    names = [*sources, *(f"cases/{name}" for name in CASES)]
    if only is None:
        executed.all_cases({name: room for name, (_, room, _) in CASES.items()})
    elif only not in names:
        raise executed.RunError(f"there is no page '{only}': expected one of {', '.join(names)}")
    chosen = names if only is None else [only]
    for name in chosen:
        if name in sources:
            text = complete(sources[name].read_text())
            text = _with_files(text, sources[name].parent, (target / name).parent)
        else:
            text = case_page(name.removeprefix("cases/"), target)
        _check_links(name, text)
        if name in TUTORIALS:
            text = _with_download(name, text, target)
        _write(target / f"{name}.md", text)
    for old in [*target.glob("*.md"), *target.glob("*/*.md")]:
        if str(old.relative_to(target).with_suffix("")) not in chosen:
            old.unlink()
    for picture in [*ROOT.glob("cases/costs/trade/*.png"), ROOT / "cases/extremes/map.png"]:
        _copy(picture, target / picture.parent.name)
    for picture in (SOURCE / "pictures").glob("*.*"):
        _copy(picture, target / "pictures")
    if only in (None, "cases/index", "index"):
        draw_thumbnails(target / "cases" / "thumbnails")
    return chosen


def draw_thumbnails(target: Path, names: Iterable[str] = thumbnails.PARTS) -> None:
    """Write the thumbnails of cases, which are run if necessary, to a folder as NAME.png."""
    for name in names:
        thumbnails.draw(name, executed.case(CASES[name][1], name).folder, target / f"{name}.png")


def _with_files(text: str, source: Path, target: Path) -> str:
    """A page whose files to include are named from another folder."""
    return re.sub(
        r"^(```\{(?:literal)?include\}) (\S+)$",
        lambda match: f"{match[1]} {os.path.relpath(source / match[2], target)}",
        text,
        flags=re.MULTILINE,
    )


def _copy(file: Path, folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    shutil.copy2(file, folder)


def _with_download(name: str, text: str, target: Path) -> str:
    """The page of a tutorial with a link to its notebook below the title."""
    _write(target / "notebooks" / f"{name}.ipynb", notebooks.download(text))
    link = f"{{download}}`Download this page as a notebook <notebooks/{name}.ipynb>`"
    return re.sub(r"^(# .+\n)", rf"\1\n{link}\n", text, count=1, flags=re.MULTILINE)


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


def problems(html: Path) -> list[str]:
    """Addresses that pages would load from the web, and paths of this machine, with the page."""
    found = []
    for page in sorted(html.rglob("*.html")):
        text = page.read_text()
        name = page.relative_to(html)
        found += [
            f"{name}: {address} would be loaded from the web" for address in LOADED.findall(text)
        ]
        found += [f"{name}: shows the path {ROOT} of this machine"] * (str(ROOT) in text)
    return found


def complete(text: str) -> str:
    """A page with its generated parts inserted."""
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


def case_page(name: str, target: Path) -> str:
    """Page of a case: its description, its figures, its code and its output."""
    title, room, beside = CASES[name]
    output = executed.case(room, name)
    for picture in output.pictures:
        _copy(picture, target / "cases" / name)
    folder = ROOT / "cases" / room / name
    if folder.is_dir():
        files = [*(folder / f"{module}.py" for module in beside), folder / "__main__.py"]
    else:
        files = [folder.with_suffix(".py")]
    options = executed.SHORTER.get(name, ())
    module = f"cases.{room}.{name}"
    about = "\n\n".join(markdown(_docstring(file)) for file in files)
    command = " ".join(["python -m", module, *options])
    shorter = f" The whole study is `python -m {module}`." if options else ""
    pictures = "\n\n".join(
        f"![{title}: {path.stem.replace('_', ' ')}]({name}/{path.name})" for path in output.pictures
    )
    return (
        f"# {title}\n\n{about}\n\n{pictures}\n\n"
        f"## Output\n\n`{command}` took {_duration(output.seconds)}.{shorter}\n\n"
        f"````{{code-block}} text\n:class: long\n\n{output.text.strip()}\n````\n\n"
        "## Code\n\n" + "\n".join(_listing(file, target / "cases") for file in files)
    )


def _listing(file: Path, page: Path) -> str:
    """Source of a file, folded up, for a page in a folder."""
    name = file.relative_to(ROOT)
    return (
        f":::{{dropdown}} {name}\n```{{literalinclude}} {os.path.relpath(file, page)}\n"
        ":language: python\n```\n:::\n"
    )


def markdown(text: str) -> str:
    """A docstring as Markdown: indented parts and commands are blocks of code, the rest is text."""
    found = []
    for kind, group in groupby(re.split(r"\n(?:[ ]*\n)+", text), _block):
        if kind:
            found.append("````text\n" + textwrap.dedent("\n\n".join(group)) + "\n````")
        else:
            found.extend(map(_escaped, group))
    return "\n\n".join(found)


def _block(part: str) -> str:
    """Kind of a block of code; empty for text."""
    return "indented" if part[0] == " " else "command" if part.startswith("python ") else ""


def _escaped(part: str) -> str:
    """A paragraph with the special characters of Markdown escaped outside of code."""
    pieces = re.split(r"(`[^`]*`)", part.replace("\n", " "))
    return "".join(piece if piece[:1] == "`" else messages.plain(piece) for piece in pieces)


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
        sections.append(f"### {title}\n\n{picture}\n\n{words}")
    return "\n\n".join(sections)


def _extremes() -> str:
    """Outcomes by subject, and the limits of each series behind them."""
    folder = ROOT / "cases" / "extremes"
    lines = list(csv.DictReader((folder / "summary.csv").read_text().splitlines()))
    table = ["| subject | green | yellow | refused | first yellow or refused |", "| --- " * 5 + "|"]
    for line in lines:
        first = line["first_yellow"] or line["first_refused"]
        counts = " | ".join(line[kind] for kind in ("green", "yellow", "refused"))
        table.append(f"| {line['subject']} | {counts} | {first} |")
    limits = (folder / "limits.txt").read_text()
    behind = f":::{{dropdown}} The limits of each series\n```text\n{limits}```\n:::"
    return "\n".join(table) + f"\n\n{behind}"


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
    study = executed.case("verification", "cantilever").folder
    with open(study / "cantilever.csv") as file:
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


def _names() -> str:
    """Table of the public names by page of the API."""
    lines = ["| to | names |", "| --- | --- |"]
    for name in re.findall(r"^\w+$", (SOURCE / "api" / "index.md").read_text(), re.MULTILINE):
        text = (SOURCE / "api" / f"{name}.md").read_text()
        names = [f"{{py:obj}}`{n} <tawami.{n}>`" for n in documented(text) if "." not in n]
        lines.append(f"| {{doc}}`{name}` | {', '.join(names)} |")
    return "\n".join(lines)


def documented(text: str) -> list[str]:
    """Names below `tawami` that a page of the API documents."""
    return re.findall(
        r"^\.\. auto(?:class|function|exception):: tawami\.(\S+)$", text, re.MULTILINE
    )


GENERATED: dict[str, Callable[[], str]] = {
    "trade": _trade,
    "extremes": _extremes,
    "compatibility": _compatibility,
    "peers": _peers,
    "form sizes": _sizes,
    "classes": _classes,
    "messages": messages.listing,
    "names": _names,
}
