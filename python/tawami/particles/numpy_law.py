"""Material laws in NumPy, to test a law before it is written in Rust."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from tawami import _rust
from tawami.base import checks
from tawami.base.arrays import Array
from tawami.base.errors import InputError
from tawami.base.identity import text
from tawami.form.kinematics import Kinematics

#: Stress, tangent and plastic volumetric strain of the particles, flat.
Given = tuple[Array, Array, Array]
#: Share by which the mean stress of a law may differ from that of the form, and share of K below which
#: its derivative with respect to the volume counts as zero.
REACHED, FLAT = 1e-13, 1e-9
#: Iterations for the volume at which a law has a mean stress.
MOST_ITERATIONS = 60


@dataclass(frozen=True)
class NumpyLaw:
    """A law for all particles of a scene at once.

    Components are xx, yy, zz, xy, as in the stress of the particles, tension positive. A strain contains
    gamma_xy = 2 eps_xy, so that tangent[:, i, j] = d stress_i / d strain_j.

    Args:
        respond: Function of the strain increment (n x 4) and the old stress (n x 4) [Pa]. It returns
            the new stress (n x 4) [Pa] and the consistent tangent (n x 4 x 4) [Pa], and must not change
            its arguments.
        K: Bulk modulus in forms and in the scaling [Pa]; finite.
        mu: Shear modulus in forms and in the scaling [Pa].

    Raises:
        InputError: K or mu is not a positive, finite number.
    """

    respond: Callable[[Array, Array], tuple[npt.ArrayLike, npt.ArrayLike]]
    K: float
    mu: float

    def __post_init__(self) -> None:
        if not callable(self.respond):
            raise InputError(
                f"NumpyLaw: respond = {checks.shown(self.respond)}: expected a function of strain and "
                "stress"
            )
        self.elastic()

    def identity(self) -> Any:
        """Facts that identify the law, besides K and mu, for checkpoints."""
        return text(self.respond)

    def elastic(self) -> _rust.Material:
        """The elastic law of K and mu, for uses that need only these."""
        try:
            K, mu = checks.real("K", self.K), checks.real("mu", self.mu)
            return _rust.Material.of("linear_elastic", (K, mu), [])
        except InputError as error:
            raise InputError(f"NumpyLaw: {error}") from None


class NumpyStage:
    """`_rust.Stage` with a law in NumPy.

    Args:
        stage: The stage in Rust, which gives the strains.
        particles: The particles, with the old stress.
        law: The law.
        kinematics: Of the form. Where it has a field for the mean stress, the volumetric strain of a
            particle is that with which the law has this mean stress.
    """

    def __init__(
        self,
        stage: _rust.Stage,
        particles: _rust.Particles,
        law: NumpyLaw,
        kinematics: Kinematics,
    ) -> None:
        self._stage, self._particles, self._law = stage, particles, law
        self._kinematics = kinematics
        self.volume_strains, self.elastic_energy = stage.volume_strains, stage.elastic_energy
        self._latest: tuple[tuple[Array, ...], Given] | None = None

    def _given(self, u: Array, volumetric: Array | None) -> Given:
        """Stress, tangent and plastic volume, flat; those of the last call are reused, as when a step is
        accepted.
        """
        state = (u, np.empty(0) if volumetric is None else volumetric, self._particles.stress)
        if self._latest is not None and all(map(np.array_equal, state, self._latest[0])):
            return self._latest[1]
        strain = np.asarray(self._stage.strains(u, volumetric))
        if len(strain) == 0:  # a rank without particles
            return np.empty(0), np.empty(0), np.empty(0)
        if self._kinematics.has_mean_stress:
            field = np.asarray(self._stage.volume_strains(u, volumetric))[:, 1]
            stress, tangent, plastic = self._at_mean(strain, field)
        else:
            (stress, tangent), plastic = self._respond(strain), np.zeros(len(strain))
        given = stress.ravel(), tangent.ravel(), plastic
        self._latest = (tuple(part.copy() for part in state), given)
        return given

    def _at_mean(self, strain: Array, field: Array) -> tuple[Array, Array, Array]:
        """Stress and tangent where the law has the mean stress of the field, and the plastic volume.

        Args:
            strain: Strain increments, n x 4; their volume is not used.
            field: eps_v or p at the particles.

        Raises:
            InputError: The law does not reach the mean stress of a particle, or its tangent has no mean
                part.
        """
        K, with_p = self._law.K, self._kinematics.deviatoric
        elastic = field / K if with_p else field
        old = _mean(self._particles.stress)
        wanted = old + (field if with_p else K * field)
        deviator = strain - _volumes(strain[:, :3].sum(axis=1))
        total = elastic.copy()
        for _ in range(MOST_ITERATIONS):
            whole = deviator + _volumes(total)
            stress, tangent = self._respond(whole)
            slope = tangent[:, :3, :3].mean(axis=(1, 2))
            missing = wanted - _mean(stress)
            size = np.abs(wanted) + np.abs(old) + K * np.abs(whole).max(axis=1)
            off = np.abs(missing) > REACHED * size
            flat = slope < FLAT * K
            if not off.any():
                self._check(
                    flat, "a tangent without a mean part (d mean stress / d volume)", strain, slope
                )
                return stress, tangent, total - elastic
            # where the slope is zero, go back towards it with the elastic one
            total[off] += (missing / np.where(flat, K, slope))[off]
        self._check(off, "no mean stress of the size that the field has", strain, wanted)
        raise AssertionError

    def _check(self, bad: npt.NDArray[np.bool_], what: str, strain: Array, value: Array) -> None:
        """Raise an error if the law has no response at the mean stress of the form."""
        if not bad.any():
            return
        p = int(np.flatnonzero(bad)[0])
        raise InputError(
            f"NumpyLaw: respond returned {what} at {bad.sum()} particles, the first is "
            f"{self._particles.number[p]}, with {value[p]:.4g} Pa and the strain increment {strain[p]}. "
            "A form with a field for the mean stress needs one: expected a law whose mean stress grows "
            "with the volume, or form 'u' or 'u_bbar'"
        )

    def _respond(self, strain: Array) -> tuple[Array, Array]:
        """Stress (n x 4) and tangent (n x 4 x 4) of the law at total strain increments."""
        n = len(strain)
        result = self._law.respond(strain, self._particles.stress.copy())
        if not isinstance(result, tuple) or len(result) != 2:
            raise InputError("NumpyLaw: respond did not return a pair: expected (stress, tangent)")
        arrays = []
        for name, values, shape in (
            ("stress", result[0], (n, 4)),
            ("tangent", result[1], (n, 4, 4)),
        ):
            what = f"NumpyLaw: the {name} that respond returned"
            raw = checks.any_array(what, values)
            array = checks.array(what, raw, raw.ndim)
            if array.shape != shape:
                raise InputError(
                    f"NumpyLaw: respond returned a {name} of shape {array.shape}: expected {shape}"
                )
            bad = np.flatnonzero(~np.isfinite(array.reshape(n, -1)).all(axis=1))
            if len(bad):
                raise InputError(
                    f"NumpyLaw: respond returned a {name} that is not finite at {len(bad)} "
                    f"particles, the first is {self._particles.number[bad[0]]}, with the strain "
                    f"increment {strain[bad[0]]}"
                )
            arrays.append(array)
        return arrays[0], arrays[1]

    def evaluate(
        self,
        u: Array,
        volumetric: Array | None,
        requests: _rust.Requests,
        data: Sequence[Array],
    ) -> None:
        """See `_rust.Stage.evaluate`."""
        self._stage.evaluate(u, volumetric, requests, data, self._given(u, volumetric))

    def tangent(self, u: Array, volumetric: Array | None) -> Array:
        """Tangent of the law (n x 4 x 4) [Pa] at increments of the fields."""
        return self._given(u, volumetric)[1].reshape(-1, 4, 4).copy()

    def commit(self, u: Array, volumetric: Array | None) -> float:
        """See `_rust.Stage.commit`."""
        dissipated = self._stage.commit(u, volumetric, self._given(u, volumetric))
        self._latest = None
        return dissipated


def _mean(stress: Array) -> Array:
    """Mean stress of each row."""
    return np.asarray(stress[:, :3].mean(axis=1))


def _volumes(volume: Array) -> Array:
    """Isotropic strains with these volumes, n x 4."""
    return np.asarray(volume[:, None] / 3 * [1.0, 1.0, 1.0, 0.0])
