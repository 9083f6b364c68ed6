"""The responses of particles some of whose laws are written in NumPy."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from tawami import _rust
from tawami.base.arrays import Array, Indices
from tawami.base.errors import InputError
from tawami.base.space import PLANE
from tawami.form.kinematics import Kinematics
from tawami.particles.numpy_law import NumpyLaw, Response, Start

#: Share by which the mean stress of a law may differ from that of the form, and share of K below which
#: its derivative with respect to the volume counts as zero.
REACHED, FLAT = 1e-13, 1e-9
#: Iterations for the volume at which a law has a mean stress.
MOST_ITERATIONS = 60
#: Calls of a law without a tangent in an evaluation: the stress, and two for each component of strain.
CALLS = 1 + 2 * len(PLANE.tensor)
#: Isotropic strain of volume 1.
ISOTROPIC = np.array([1.0, 1.0, 1.0, 0.0]) / 3


@dataclass(frozen=True)
class Given:
    """Responses for `_rust.Stage`; rows of particles with a law in Rust stay 0.

    Attributes:
        stress: n x 4 [Pa].
        tangent: n x 4 x 4 [Pa].
        plastic_volume: Volumetric strain of the step that is not elastic (n); 0 in forms without a field
            for the mean stress.
        history: n x variables.
        slopes: d history / d strain, n x variables x 4; None if it was not asked for.
    """

    stress: Array
    tangent: Array
    plastic_volume: Array
    history: Array
    slopes: Array | None

    @property
    def flat(self) -> tuple[Array, Array, Array, Array, Array]:
        """The arrays, as Rust takes them."""
        slopes = np.empty(0) if self.slopes is None else self.slopes.ravel()
        return (
            self.stress.ravel(), self.tangent.ravel(), self.plastic_volume, self.history.ravel(), slopes,
        )  # fmt: skip


class NumpyStage:
    """`_rust.Stage` with laws in NumPy. Each of them is called with all its particles of this rank.

    Args:
        stage: The stage in Rust, which gives the strains and has the laws in Rust.
        particles: The particles, with old stress and history.
        laws: Laws in NumPy by the number of their material.
        kinematics: Of the form. Where it has a field for the mean stress, the volumetric strain of a
            particle is that with which the law has this mean stress.
        finite: Whether strains are finite.

    Attributes:
        differenced: Numbers of the laws that returned no tangent.
    """

    def __init__(
        self,
        stage: _rust.Stage,
        particles: _rust.Particles,
        laws: Mapping[int, NumpyLaw],
        kinematics: Kinematics,
        *,
        finite: bool,
    ) -> None:
        self._stage, self._particles = stage, particles
        self._kinematics, self._finite = kinematics, finite
        self._rows = {
            number: (law, rows)
            for number, law in laws.items()
            if len(rows := np.flatnonzero(particles.material == number))
        }
        self._names = list(dict.fromkeys(name for law in laws.values() for name in law.history))
        self._variables = max(len(law.history) for law in laws.values())
        self.volume_strains, self.elastic_energy = stage.volume_strains, stage.elastic_energy
        self.differenced: set[int] = set()
        self._latest: tuple[tuple[Array, ...], Given] | None = None

    def _given(self, u: Array, volumetric: Array | None, *, slopes: bool = False) -> Given:
        """Responses of all laws; those of the last call are reused, as when a step is accepted."""
        particles = self._particles
        histories = [particles.history(name) for name in self._names]
        state = (u, np.empty(0) if volumetric is None else volumetric, particles.stress, *histories)
        if (
            self._latest is not None
            and all(map(np.array_equal, state, self._latest[0]))
            and not (slopes and self._latest[1].slopes is None)
        ):
            return self._latest[1]
        n = len(particles)
        strain = np.asarray(self._stage.strains(u, volumetric))
        field = np.asarray(self._stage.volume_strains(u, volumetric))[:, 1]
        given = Given(
            np.zeros((n, 4)), np.zeros((n, 4, 4)), np.zeros(n), np.zeros((n, self._variables)),
            np.zeros((n, self._variables, 4)) if slopes else None,
        )  # fmt: skip
        for number, (law, rows) in self._rows.items():
            start = self._start(law, rows)
            total, plastic, found = self._at(start, strain[rows], field[rows])
            tangent, of_history = found.tangent, None
            if tangent is None or (slopes and law.history):
                differences, of_history = start.differences(total)
                if tangent is None:
                    tangent = differences
                    self.differenced.add(number)
            variables = slice(len(law.history))
            given.stress[rows], given.tangent[rows] = found.stress, tangent
            given.plastic_volume[rows], given.history[rows, variables] = plastic, found.history
            if given.slopes is not None and of_history is not None:
                given.slopes[rows, variables] = of_history
        self._latest = (tuple(part.copy() for part in state), given)
        return given

    def _start(self, law: NumpyLaw, rows: Indices) -> Start:
        """State of some particles at the start of the step, as their law receives it."""
        particles = self._particles
        stress = np.zeros((len(rows), 4)) if self._finite else particles.stress[rows]
        columns = [particles.history(name)[rows] for name in law.history]
        history = np.column_stack(columns) if columns else np.empty((len(rows), 0))
        return Start(law, stress, history, particles.number[rows])

    def _at(self, start: Start, strain: Array, field: Array) -> tuple[Array, Array, Response]:
        """Total strain, plastic volume and response of the particles of a law.

        Args:
            start: State of the particles.
            strain: Their strain in two parts, deviator and volume: n x 5.
            field: eps_v or p at the particles.

        Raises:
            InputError: The law does not reach the mean stress of a particle, or its tangent has no mean
                part.
        """
        deviator, volume = strain[:, :4], strain[:, 4]
        if not self._kinematics.has_mean_stress:
            total = deviator + np.outer(volume, ISOTROPIC)
            return total, np.zeros(len(total)), start.respond(total)
        K, old = start.law.K, _mean(start.stress)
        with_p = self._kinematics.deviatoric
        elastic = field / K if with_p else volume
        wanted = old + (field if with_p else K * volume)
        moved = elastic.copy()
        for _ in range(MOST_ITERATIONS):
            total = deviator + np.outer(moved, ISOTROPIC)
            found = start.respond(total)
            slope = _bulk(start, total, found)
            missing = wanted - _mean(found.stress)
            size = np.abs(wanted) + np.abs(old) + K * np.abs(total).max(axis=1)
            off = np.abs(missing) > REACHED * size
            flat = slope < FLAT * K
            if not off.any():
                _check(
                    start,
                    flat,
                    "a tangent without a mean part (d mean stress / d volume)",
                    total,
                    slope,
                )
                return total, moved - elastic, found
            # where the slope is zero, go back towards it with the elastic one
            moved[off] += (missing / np.where(flat, K, slope))[off]
        _check(start, off, "no mean stress of the size that the field has", total, wanted)
        raise AssertionError

    def evaluate(
        self,
        u: Array,
        volumetric: Array | None,
        requests: _rust.Requests,
        data: Sequence[Array],
    ) -> None:
        """See `_rust.Stage.evaluate`."""
        given = self._given(u, volumetric, slopes=requests.history_slopes)
        self._stage.evaluate(u, volumetric, requests, data, given.flat)

    def tangent(self, u: Array, volumetric: Array | None) -> Array:
        """Tangent of the laws in NumPy [Pa] at increments of the fields, n x 4 x 4; others are 0."""
        return self._given(u, volumetric).tangent.copy()

    def commit(self, u: Array, volumetric: Array | None, *, volume: Array | None = None) -> float:
        """See `_rust.Stage.commit`."""
        given = self._given(u, volumetric).flat
        dissipated = self._stage.commit(u, volumetric, given, volume)
        self._latest = None
        return dissipated


def _check(
    start: Start, bad: npt.NDArray[np.bool_], what: str, strain: Array, value: Array
) -> None:
    """Raise an error if the law has no response at the mean stress of the form."""
    if not bad.any():
        return
    p = int(np.flatnonzero(bad)[0])
    raise InputError(
        f"{start.law.name}: respond returned {what} at {bad.sum()} particles, the first is "
        f"{start.number[p]}, with {value[p]:.4g} Pa and the strain {strain[p]}. A form with a field for "
        "the mean stress needs one: expected a law whose mean stress grows with the volume, or form 'u' "
        "or 'u_bbar'"
    )


def _mean(stress: Array) -> Array:
    """Mean stress of each row."""
    return np.asarray(stress[:, :3].mean(axis=1))


def _bulk(start: Start, strain: Array, found: Response) -> Array:
    """d mean stress / d volume [Pa] of each particle."""
    if found.tangent is not None:
        return np.asarray(found.tangent[:, :3, :3].mean(axis=(1, 2)))
    return _mean(start.slope(strain, ISOTROPIC)[0])
