"""The particles of a body with their materials."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from tawami import _rust
from tawami.base import checks
from tawami.body import rings
from tawami.body.body import Body
from tawami.form.form import Form
from tawami.grid.grid import Grid
from tawami.particles import assignment, placement
from tawami.particles.assignment import Law


def particles(
    grid: Grid,
    body: Body,
    material: assignment.Given,
    material_of: npt.ArrayLike | None,
    form: Form,
) -> tuple[_rust.Particles, list[Law]]:
    """The particles of the body on this rank with their materials and history variables.

    Raises:
        InputError: An array of another shape, materials that do not fit, or no particle.
    """
    x, volume = checks.array("x", body.x, 2), checks.array("volume", body.volume, 1)
    volume = rings.volumes(grid, x, volume)
    assigned = assignment.assigned(material, material_of, body, len(x))
    if body.part is None or not body.part.total:
        made = _rust.Particles(x, volume, assigned.number)
    else:  # a rank may have none
        some = _rust.Particles(
            np.concatenate([x, np.zeros((1, grid.space.dim))]),
            np.append(volume, 1.0),
            np.append(assigned.number, np.uint32(0)),
        )
        made = some.select(np.arange(len(x), dtype=np.uint32))
        made = placement.numbered(made, body.part.number)
    materials = assignment.materials_of(assigned.laws)
    made.check_materials(materials, form.kinematics.name, form.strain.finite)
    made.add_history(materials)
    return made, assigned.laws
