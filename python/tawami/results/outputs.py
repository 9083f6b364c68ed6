"""Outputs of particles, border and grid as series of VTU files.

ParaView and pyvista open a series by its index (.pvd). A vertex of the grid without particles around
it has no stress: NaN, which ParaView draws in its NaN colour. A threshold of `particles [-]` from 1
leaves the cells of the body.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from tawami.base.errors import NotModelledError
from tawami.base.ranks import raise_together, same
from tawami.motion.observer import Snapshot, Subject
from tawami.quantities.quantities import Given, of_particles, usual_of_particles
from tawami.results.frame import Frame, border_frame, grid_frame, particle_frame
from tawami.results.grid_quantities import on_grid, usual_on_grid
from tawami.results.output import Output
from tawami.results.projection import Projection, check_projection
from tawami.results.series import Series
from tawami.results.vtu import write_vtu


class _SeriesOutput(Output):
    """One file a snapshot, and an index of them."""

    def _open(self, folder: Path, last: int | None, subject: Subject) -> None:
        self._series = Series(folder, self.name)
        self._series.begin(last)

    def _write(self, snapshot: Snapshot, size: float) -> None:
        frame, comm = self._frame(snapshot), snapshot.scene.grid.comm
        path = self._series.path(snapshot.step) if comm.rank == 0 else Path()
        write_vtu(same(comm, path), frame, comm)
        with raise_together(comm):
            if comm.rank == 0:
                self._series.add(snapshot.step, snapshot.time)

    def _frame(self, snapshot: Snapshot) -> Frame:
        raise NotImplementedError


class ParticleOutput(_SeriesOutput):
    """Particles as points, in the order of their numbers.

    Args:
        names: 'displacement', 'stress', 'mean stress', 'deviatoric stress q' (Kirchhoff's at finite
            strain), 'strain' (as in `Solution`), 'volume' (at the start), 'eps_v', 'velocity',
            'acceleration', 'material', 'number', a history variable of the laws, or a
            :class:`Quantity` of your own; by default the usual quantities of the scene.
        every, every_steps: When; see `Output`. Every step by default.
        name: Of index and folder.
        phases: As in `Output`.
    """

    def __init__(
        self,
        *names: Given,
        every: float | None = None,
        every_steps: int | None = None,
        name: str = "particles",
        phases: Sequence[str] | None = None,
    ) -> None:
        super().__init__(names, every, every_steps, name, phases)

    def _resolve(self, subject: Subject) -> None:
        self._quantities = of_particles(self.names or usual_of_particles(subject), subject)

    def _frame(self, snapshot: Snapshot) -> Frame:
        return particle_frame(self._quantities, snapshot.subject)


class BorderOutput(_SeriesOutput):
    """The border of the body as short lines, one for each of its points.

    Each has its displacement since the start [m] at both ends, its outward normal, the area that it
    counts for [m2 per metre depth], the number of its part among `scene.border.names`, and the traction
    [Pa] of loads and of supports on patches. Supports on edges of the grid are left out: their forces
    are those of the grid (`GridOutput("reaction")`). At small strain the lines are those of the start.

    Args:
        every, every_steps: When; see `Output`. Every step by default.
        name: Of index and folder.
        phases: As in `Output`.

    Raises:
        NotModelledError: The body has no border; raised by the run.
    """

    takes_quantities = False

    def __init__(
        self,
        *,
        every: float | None = None,
        every_steps: int | None = None,
        name: str = "border",
        phases: Sequence[str] | None = None,
    ) -> None:
        super().__init__((), every, every_steps, name, phases)

    def _resolve(self, subject: Subject) -> None:
        if subject.scene.configuration.border.points is None:
            raise NotModelledError(
                f"BorderOutput: '{self.name}' needs a body with a border: expected "
                "Body(x, volume, border=tawami.polyline(corners)), or a body of box, polygon, disc, "
                "level_set or mesh"
            )

    def _frame(self, snapshot: Snapshot) -> Frame:
        return border_frame(snapshot)


class GridOutput(_SeriesOutput):
    """Cells of the grid.

    Args:
        names: 'displacement' (of the last step at finite strain), 'velocity', 'eps_v' or 'p' (since
            the start, without an initial stress), 'particles' (in each cell), 'reaction' (of supports
            and walls, distributed to the vertices with the same sum and moment), or, projected from
            the particles, 'stress', 'mean stress', 'deviatoric stress q', 'strain', a history variable,
            at finite strain 'eps_v', or a :class:`Quantity` of your own.
        every, every_steps, name, phases: As in `ParticleOutput`.
        projection: 'lumped' or 'consistent'; see `tawami.results.projection`.
    """

    def __init__(
        self,
        *names: Given,
        every: float | None = None,
        every_steps: int | None = None,
        name: str = "grid",
        phases: Sequence[str] | None = None,
        projection: Projection = "lumped",
    ) -> None:
        super().__init__(names, every, every_steps, name, phases)
        self._projection = check_projection(projection)

    def _resolve(self, subject: Subject) -> None:
        names = self.names or usual_on_grid(subject.scene)
        self._quantities = on_grid(names, subject, self._projection)

    def _frame(self, snapshot: Snapshot) -> Frame:
        return grid_frame(self._quantities, snapshot)
