"""Small pictures of the cases, cut from their figures, for the site and for README."""

from __future__ import annotations

from pathlib import Path

from PIL import Image, ImageChops

SIZE = (300, 200)  # [pixels]
#: Figure of each case and the part shown: left, upper, right, lower, as shares of width and height.
PARTS: dict[str, tuple[str, tuple[float, float, float, float]]] = {
    "cantilever": ("mean_stress_paper.png", (0.0, 0.67, 0.84, 1.0)),
    "cook": ("mean_stress.png", (0.24, 0.175, 0.648, 0.91)),
    "cut_cells": ("cut_cells.png", (0.0, 0.0, 0.5, 1.0)),
    "one_line": ("mean_stress.png", (0.0, 0.0, 0.88, 1.0)),
    "elastica": ("shapes.png", (0.0, 0.335, 0.62, 1.0)),
    "footing": ("zones.png", (0.0, 0.0, 0.86, 0.5)),
    "rigid_footing": ("rigid_footing.png", (0.0, 0.0, 0.5, 1.0)),
    "vibrating_beam": ("motion.png", (0.0, 0.0, 0.5, 0.33)),
    "spinning_disc": ("film.png", (0.0, 0.0, 0.262, 0.315)),
    "consolidation": ("consolidation.png", (0.333, 0.0, 0.667, 1.0)),
    "soft_clay": ("soft_clay.png", (0.0, 0.0, 0.333, 1.0)),
    "heated_wall": ("heated_wall.png", (0.0, 0.0, 0.5, 1.0)),
    "ring": ("ring.png", (0.5, 0.0, 1.0, 1.0)),
    "creep": ("creep.png", (0.0, 0.0, 0.5, 1.0)),
    "fracture": ("fracture.png", (0.37, 0.17, 0.62, 0.745)),
    "penetration": ("penetration.png", (0.5, 0.5, 1.0, 1.0)),
    "rolling": ("rolling.png", (0.0, 0.0, 1.0, 1.0)),
    "collapse": ("film.png", (0.0, 0.165, 0.305, 0.645)),
}
#: Cases of README's gallery.
README = (
    "cantilever", "cook", "one_line", "footing",
    "elastica", "vibrating_beam", "spinning_disc", "collapse",
)  # fmt: skip


def draw(name: str, folder: Path, target: Path) -> None:
    """Write the thumbnail of a case as PNG.

    Args:
        name: Case, a key of `PARTS`.
        folder: Folder of its figures.
        target: File to write, of `SIZE`.
    """
    figure, part = PARTS[name]
    with Image.open(folder / figure) as picture:
        whole = picture.convert("RGB")
    sides = (whole.width, whole.height, whole.width, whole.height)
    cut = whole.crop(tuple(round(s * length) for s, length in zip(part, sides, strict=True)))
    box = ImageChops.difference(cut, Image.new("RGB", cut.size, "white")).getbbox()
    cut = cut.crop(box)
    cut.thumbnail(SIZE, Image.Resampling.LANCZOS)
    canvas = Image.new("RGB", SIZE, "white")
    canvas.paste(cut, ((SIZE[0] - cut.width) // 2, (SIZE[1] - cut.height) // 2))
    target.parent.mkdir(parents=True, exist_ok=True)
    canvas.quantize(96).save(target, optimize=True)
