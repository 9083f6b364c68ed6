"""Material laws in NumPy, to try one out before it is written in Rust."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from tawami import _rust
from tawami.base import checks
from tawami.base.arrays import Array
from tawami.base.errors import InputError
from tawami.base.source import source_of


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

    @property
    def source(self) -> str:
        """Source text of the function."""
        return source_of(self.respond)

    def elastic(self) -> _rust.Material:
        """The elastic law of K and mu, for uses that need only these."""
        try:
            K, mu = checks.real("K", self.K), checks.real("mu", self.mu)
            return _rust.Material.linear_elastic_k_mu(K, mu)
        except InputError as error:
            raise InputError(f"NumpyLaw: {error}") from None


class NumpyStage:
    """`_rust.Stage` with a law in NumPy.

    Args:
        stage: The stage in Rust, which gives the strains.
        particles: The particles, with the old stress.
        law: The law.
    """

    def __init__(self, stage: _rust.Stage, particles: _rust.Particles, law: NumpyLaw) -> None:
        self._stage, self._particles, self._law = stage, particles, law
        self.volume_strains, self.elastic_energy = stage.volume_strains, stage.elastic_energy
        self._latest: tuple[tuple[Array, ...], tuple[Array, Array]] | None = None

    def _given(self, u: Array, volumetric: Array | None) -> tuple[Array, Array]:
        """Stress and tangent, flat; those of the last call are reused, as when a step is accepted."""
        state = (u, np.empty(0) if volumetric is None else volumetric, self._particles.stress)
        if self._latest is not None and all(map(np.array_equal, state, self._latest[0])):
            return self._latest[1]
        given = self._respond(self._stage.strains(u, volumetric))
        self._latest = (tuple(part.copy() for part in state), given)
        return given

    def _respond(self, strain: Array) -> tuple[Array, Array]:
        n = len(strain)
        if n == 0:  # a rank without particles
            return np.empty(0), np.empty(0)
        result = self._law.respond(strain, self._particles.stress.copy())
        if not isinstance(result, tuple) or len(result) != 2:
            raise InputError("NumpyLaw: respond returned no pair: expected (stress, tangent)")
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
            arrays.append(array.ravel())
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

    def commit(self, u: Array, volumetric: Array | None) -> float:
        """See `_rust.Stage.commit`."""
        dissipated = self._stage.commit(u, volumetric, self._given(u, volumetric))
        self._latest = None
        return dissipated
