"""Quantities of the grid by name: its own, and quantities of the particles that are projected on it."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from tawami import _rust
from tawami.base.arrays import Array
from tawami.base.errors import InputError, NotModelledError
from tawami.grid import edges
from tawami.grid.basis import extraction, greville_1d, values_1d
from tawami.motion.observer import Snapshot, Subject
from tawami.motion.transfer import to_grid
from tawami.quantities.quantities import (
    HISTORY,
    PARTICLES,
    Given,
    Quantity,
    local_arrays,
    of_particles,
    of_scene,
    own_values,
    unknown,
)
from tawami.results.projection import Projection, nodal
from tawami.scene.scene import Scene


@dataclass(frozen=True)
class GridQuantity:
    """A field of the grid.

    Attributes:
        label: Its name in files.
        of: Its values at the vertices or in the cells of this rank; a call for all ranks.
        cells: Whether it has one value per cell.
    """

    label: str
    of: Callable[[Snapshot], Array]
    cells: bool = False


def on_grid(
    names: Iterable[Given], subject: Subject, projection: Projection = "lumped"
) -> list[GridQuantity]:
    """Fields of the grid by their names: its own, or projected fields of the particles.

    Raises:
        NotModelledError, InputError: As `of_particles`.
    """
    scene = subject.scene
    own = _of_grid(scene)
    of_particle = PARTICLES | of_scene(scene)
    projected = [name for name, quantity in of_particle.items() if quantity.nodal]
    found = []
    for name in names:
        if isinstance(name, Quantity):
            found.append(_projected_own(of_particles([name], subject)[0], projection))
        elif name == "p" and name not in own:
            raise NotModelledError(
                f"p: form {scene.form.name} has no pressure: expected form='u_p'"
            )
        elif name in own:
            if name == "velocity":
                of_particles([name], subject)
            found.append(own[name])
        elif name in projected or name in HISTORY:
            found.append(_projected(of_particles([name], subject)[0], projection))
        else:
            raise InputError(unknown("grid", name, dict.fromkeys([*own, *projected])))
    return found


def usual_on_grid(scene: Scene) -> tuple[str, ...]:
    """Quantities of an output without names."""
    return ("displacement", *list(scene.form.fields)[1:], "particles")


def _of_grid(scene: Scene) -> dict[str, GridQuantity]:
    found = {
        "displacement": GridQuantity("displacement [m]", _displacement),
        "velocity": GridQuantity("velocity [m/s]", _velocity),
        "reaction": GridQuantity(f"reaction [{scene.grid.space.short('N')}]", _reaction),
        "particles": GridQuantity("particles [-]", _particles, cells=True),
    }
    if not scene.form.strain.finite:  # else the grid has only that of the last step
        for name, field in list(scene.form.fields.items())[1:]:
            if field.basis == "bilinear":
                found[name] = GridQuantity(f"{name} [{field.unit}]", _bilinear(name))
    return found


def _projected(quantity: Quantity, projection: Projection) -> GridQuantity:
    def of(now: Snapshot) -> Array:
        return nodal(now.scene, quantity.of(local_arrays(now.subject)), projection)

    return GridQuantity(quantity.label, of)


def _projected_own(quantity: Quantity, projection: Projection) -> GridQuantity:
    """The projection of a quantity of the driver script, whose function sees the whole body."""
    if not quantity.nodal:
        raise InputError(
            f"grid: quantity '{quantity.label}' has nodal=False: expected one that can be projected, or "
            "ParticleOutput"
        )

    def of(now: Snapshot) -> Array:
        values = own_values(quantity, now.subject, local_arrays(now.subject))
        return nodal(now.scene, values, projection)

    return GridQuantity(quantity.label, of)


def _particles(now: Snapshot) -> Array:
    domain = now.scene.configuration.domain
    return domain.particles_per_cell[domain.layout.window.own].astype(float)


def _at_vertices(scene: Scene, coefficients: Array) -> Array:
    """Vectors at the vertices of this rank, given the coefficients in its window."""
    window = scene.configuration.domain.layout.window
    matrix = extraction(scene.basis, window.cells, 1)[window.vertices]
    return np.asarray(matrix @ scene.grid.space.vectors(coefficients))


def _coefficients(now: Snapshot) -> Array:
    """Coefficients in the window: of the solution, or since the start before the first one."""
    configuration = now.scene.configuration
    if now.solution is None:
        return configuration.before
    return now.solution.owned[0].picked(configuration.domain.layout.in_grid)


def _displacement(now: Snapshot) -> Array:
    """Displacement since the start; at finite strain, of the last step."""
    displacement = _coefficients(now)[: now.scene.configuration.domain.layout.num_displacement]
    return _at_vertices(now.scene, displacement)


def _bilinear(name: str) -> Callable[[Snapshot], Array]:
    """The coefficients of a field, which are its values at the vertices."""

    def of(now: Snapshot) -> Array:
        layout = now.scene.configuration.domain.layout
        return np.asarray(_coefficients(now)[layout.fields[name].slice][layout.window.vertices])

    return of


def _velocity(now: Snapshot) -> Array:
    """Velocity of the particles, weighted by mass, with its gradient; NaN without particles around."""
    motion, attached = now.subject.motion, now.scene.configuration.domain
    assert motion is not None
    kept = motion.on_grid
    if kept is not None:  # a grid that is not reset has its own velocity
        return _at_vertices(now.scene, kept[0].ravel())
    fields = [(motion.velocity, motion.velocity_gradient)]
    (momentum,) = to_grid(attached, motion.mass, fields)
    mass = attached.sums(motion.mass, np.ones((len(motion.mass), 1)))
    v = np.divide(momentum, mass, out=np.zeros_like(momentum), where=mass > 0)
    sums = attached.sums(motion.mass, np.ones((len(motion.mass), 1)), "bilinear")
    near = sums[attached.layout.window.vertices] > 0
    return np.where(near, _at_vertices(now.scene, v.ravel()), np.nan)


def _reaction(now: Snapshot) -> Array:
    """Forces of supports and walls [N per metre depth], distributed to the vertices of their cells with
    the same sum and moment; NaN before the first solution.
    """
    scene, grid, layout = now.scene, now.scene.grid, now.scene.configuration.domain.layout
    window = layout.window
    if now.solution is None:
        return np.full((len(window.vertices), grid.space.dim), np.nan)
    along = []
    for axis, n in enumerate(grid.cells):
        first = window.first_function(scene.basis)[axis]
        place = greville_1d(scene.basis, n)[first : first + window.shape(scene.basis)[axis]]
        cell = np.minimum(place.astype(np.int64), n - 1)
        begin, end = window.first[axis], window.first[axis] + window.cells[axis] + 1
        along.append(values_1d("bilinear", n, cell, place - cell)[:, begin:end])
    share = sp.kron(along[1], along[0], format="csr")
    wanted = layout.in_grid[: layout.num_displacement]
    on_functions = np.sum([forces.picked(wanted) for forces in now.solution.owned[1:]], axis=0)
    forces = np.asarray(share.T @ grid.space.vectors(on_functions))
    for point, force in now.solution.on_points:
        location = edges.locate_point(grid, point, "reaction")
        number, shares, _ = _rust.functions_at(location, "bilinear")
        at = window.functions("bilinear", number[0])
        forces[at[at >= 0]] += shares[0][at >= 0, None] * force
    return forces[window.vertices]
