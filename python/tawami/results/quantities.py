"""Quantities of the particles and of the grid, by name; columns of tables are in `columns`.

Files label them "name [unit]", tensors "stress xx yy zz xy [Pa]". A quantity that the scene does not
model gives an error that says how to model it; an unknown name gives the list of names.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from tawami import _rust
from tawami.base.arrays import Array
from tawami.base.errors import InputError, NotModelledError
from tawami.form.kinematics import FIELD_UNITS
from tawami.grid import edges
from tawami.grid.basis import extraction, greville_1d, values_1d
from tawami.motion.observer import Snapshot, Subject
from tawami.motion.transfer import to_grid
from tawami.particles import placement
from tawami.results.projection import Projection, nodal, vertices
from tawami.scene.scene import Scene
from tawami.scene.solution import Solution

#: Arrays of the particles by name.
View = Callable[[str], Array]


@dataclass(frozen=True)
class Quantity:
    """A field of the particles.

    Attributes:
        label: Its name in files.
        of: Its values, particles or particles x components, from the arrays of the particles.
        nodal: Whether it can be projected on the grid.
    """

    label: str
    of: Callable[[View], Array]
    nodal: bool = True


def _stored(name: str) -> Callable[[View], Array]:
    return lambda view: view(name)


def _mean_stress(view: View) -> Array:
    return np.asarray(view("stress")[:, :3].mean(axis=1))


def _deviatoric_stress(view: View) -> Array:
    """q = sqrt(3/2 s : s), three-dimensional."""
    stress = view("stress")
    s = stress[:, :3] - _mean_stress(view)[:, None]
    return np.asarray(np.sqrt(1.5 * ((s**2).sum(axis=1) + 2 * stress[:, 3] ** 2)))


#: Fields of the particles. History variables of the laws, which are strains, are added to them.
PARTICLES = {
    "displacement": Quantity("displacement [m]", _stored("displacement"), nodal=False),
    "stress": Quantity("stress xx yy zz xy [Pa]", _stored("stress")),
    "mean stress": Quantity("mean stress [Pa]", _mean_stress),
    "deviatoric stress q": Quantity("deviatoric stress q [Pa]", _deviatoric_stress),
    "volume": Quantity("volume [m2 per m]", _stored("volume"), nodal=False),
    "eps_v": Quantity("eps_v [-]", _stored("eps_v")),
    "velocity": Quantity("velocity [m/s]", _stored("velocity"), nodal=False),
    "acceleration": Quantity("acceleration [m/s2]", _stored("acceleration"), nodal=False),
    "material": Quantity("material [-]", _stored("material"), nodal=False),
    "number": Quantity("number [-]", _stored("number"), nodal=False),
}
#: History variables of the laws of tawami.
HISTORY = ("plastic_strain", "dilatancy")


def _history(name: str) -> Quantity:
    return Quantity(f"{name} [-]", _stored(name))


def local_view(subject: Subject) -> View:
    """Arrays of the particles of this rank."""
    particles = subject.scene.particles

    def view(name: str) -> Array:
        if name in ("velocity", "acceleration"):
            return np.asarray(getattr(subject, name))  # or the error of the scene that has none
        if name not in PARTICLES and name != "x":
            return np.asarray(particles.history(name))
        return np.asarray(getattr(particles, name))

    return view


def body_view(subject: Subject) -> View:
    """Arrays of the particles of all ranks in the order of their numbers; calls for all ranks."""
    local, comm = local_view(subject), subject.scene.grid.comm
    gather = placement.in_order(comm, local("number"))
    known: dict[str, Array] = {}

    def view(name: str) -> Array:
        if name not in known:
            known[name] = np.asarray(gather(local(name)))
        return known[name]

    return view


def solution_view(solution: Solution) -> View:
    """Arrays of the particles at the time of a solution."""
    other = {"displacement": "displacement_of_particles"}
    return lambda name: np.asarray(getattr(solution, other.get(name, name)))


def of_particles(names: Iterable[str], subject: Subject) -> list[Quantity]:
    """Fields of the particles by their names.

    Raises:
        NotModelledError: The scene does not have one; the message names the switch that adds it.
        InputError: An unknown name.
    """
    known = PARTICLES | {name: _history(name) for name in subject.scene.particles.history_names}
    view, found = local_view(subject), []
    for name in names:
        if name not in known and name not in HISTORY:
            raise InputError(_unknown("particles", name, known))
        quantity = known.get(name, _history(name))
        with _not_modelled():
            quantity.of(view)
        found.append(quantity)
    return found


def usual_of_particles(subject: Subject) -> tuple[str, ...]:
    """Quantities of an output without names."""
    scene, names = subject.scene, ["displacement", "stress", "mean stress"]
    names += ["eps_v"] if scene.form.kinematics.has_eps_v else []
    names += ["velocity"] if subject.motion is not None else []
    return (*names, *scene.particles.history_names)


def _unknown(place: str, name: str, known: Iterable[str]) -> str:
    return f"{place}: '{name}' is unknown: expected one of {', '.join(known)}"


@contextmanager
def _not_modelled() -> Iterator[None]:
    """Raise InputError of the block as NotModelledError."""
    try:
        yield
    except InputError as error:
        raise NotModelledError(str(error)) from None


# -- on the grid -------------------------------------------------------------


@dataclass(frozen=True)
class GridQuantity:
    """A field of the grid.

    Attributes:
        label: Its name in files.
        of: Its values at the vertices or in the cells, x fastest; a call for all ranks.
        cells: Whether it has one value per cell.
    """

    label: str
    of: Callable[[Snapshot], Array]
    cells: bool = False


def on_grid(
    names: Iterable[str], subject: Subject, projection: Projection = "lumped"
) -> list[GridQuantity]:
    """Fields of the grid by their names: its own, or projected fields of the particles.

    Raises:
        NotModelledError, InputError: As `of_particles`.
    """
    scene = subject.scene
    own = _of_grid(scene)
    histories = {name: _history(name) for name in scene.particles.history_names}
    projected = [name for name, quantity in (PARTICLES | histories).items() if quantity.nodal]
    found = []
    for name in names:
        if name == "p" and name not in own:
            raise NotModelledError(
                f"p: form {scene.form.name} has no pressure: expected form='u_p'"
            )
        if name in own:
            if name == "velocity":
                of_particles([name], subject)
            found.append(own[name])
        elif name in projected or name in HISTORY:
            found.append(_projected(of_particles([name], subject)[0], projection))
        else:
            raise InputError(_unknown("grid", name, dict.fromkeys([*own, *projected])))
    return found


def usual_on_grid(scene: Scene) -> tuple[str, ...]:
    """Quantities of an output without names."""
    return ("displacement", *list(scene.form.fields)[1:], "particles")


def _of_grid(scene: Scene) -> dict[str, GridQuantity]:
    found = {
        "displacement": GridQuantity("displacement [m]", _displacement),
        "velocity": GridQuantity("velocity [m/s]", _velocity),
        "reaction": GridQuantity("reaction [N/m]", _reaction),
        "particles": GridQuantity(
            "particles [-]", lambda now: now.scene.particles_per_cell.astype(float), cells=True
        ),
    }
    if not scene.form.strain.finite:  # else the grid has only that of the last step
        for name, (kind, _) in list(scene.form.fields.items())[1:]:
            found[name] = GridQuantity(f"{name} [{FIELD_UNITS[kind]}]", _bilinear)
    return found


def _projected(quantity: Quantity, projection: Projection) -> GridQuantity:
    def of(now: Snapshot) -> Array:
        return nodal(now.scene, quantity.of(local_view(now.subject)), projection)

    return GridQuantity(quantity.label, of)


def _at_vertices(scene: Scene, coefficients: Array) -> Array:
    matrix = extraction(scene.basis, scene.grid.cells, 1)
    return np.asarray(matrix @ scene.grid.space.vectors(coefficients))


def _displacement(now: Snapshot) -> Array:
    """Displacement since the start; at finite strain, of the last step."""
    scene, solution = now.scene, now.solution
    u = scene.split(scene.configuration.before)[0] if solution is None else solution.u
    return _at_vertices(scene, u)


def _bilinear(now: Snapshot) -> Array:
    scene, solution = now.scene, now.solution
    values = scene.split(scene.configuration.before)[1] if solution is None else solution.volumetric
    return np.asarray(values)


def _velocity(now: Snapshot) -> Array:
    """Velocity of the particles, weighted by mass, with its gradient; NaN without particles around."""
    motion, attached = now.subject.motion, now.scene.configuration.domain
    assert motion is not None
    kept = motion.on_grid
    if kept is not None:  # a grid that is not reset has its own velocity
        return _at_vertices(now.scene, kept[0])
    fields = [(motion.velocity, motion.velocity_gradient)]
    (momentum,) = to_grid(attached, motion.mass, fields)
    mass = attached.sums(motion.mass, np.ones((len(motion.mass), 1)))
    v = np.divide(momentum, mass, out=np.zeros_like(momentum), where=mass > 0)
    near = attached.sums(motion.mass, np.ones((len(motion.mass), 1)), "bilinear") > 0
    return np.where(near, _at_vertices(now.scene, v), np.nan)


def _reaction(now: Snapshot) -> Array:
    """Forces of supports and walls [N per metre depth], distributed to the vertices of their cells with
    the same sum and moment; NaN before the first solution.
    """
    scene, grid = now.scene, now.scene.grid
    if now.solution is None:
        return np.full((len(vertices(scene)), grid.space.dim), np.nan)
    along = []
    for n in grid.cells:
        place = greville_1d(scene.basis, n)
        cell = np.minimum(place.astype(np.int64), n - 1)
        along.append(values_1d("bilinear", n, cell, place - cell))
    share = sp.kron(along[1], along[0], format="csr")
    forces = np.asarray(share.T @ now.solution.on_edges)
    for point, force in now.solution.on_points:
        location = edges.locate_point(grid, point, "reaction")
        forces += _rust.nodal_sums(location, np.ones(1), force[None], "bilinear")
    return forces
