"""The numbers of the particles that a weak form reads by name."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from tawami import _rust
from tawami.base.arrays import Array
from tawami.base.errors import InputError
from tawami.form.form import Form


class ParticleValues(Mapping[str, Array]):
    """K, mu, rho, the position, old fields, data and parameters of this rank's particles.

    `old J` is the volume of each particle over that at the start of the scene, det F.

    Args:
        form: The form.
        particles: The particles.
        moduli: K and mu [Pa] of each material, materials x 2.
        density: Density of each material [kg/m3]; None if the scene has none.
    """

    def __init__(
        self, form: Form, particles: _rust.Particles, moduli: Array, density: Array | None
    ) -> None:
        self._form, self._particles, self._density = form, particles, density
        of_particle = moduli[particles.material]
        self._made = {"K": of_particle[:, 0].copy(), "mu": of_particle[:, 1].copy()}
        axes = range(particles.x.shape[1])
        self._position = {f"x[{axis}]": axis for axis in axes}
        self._old = {}
        for name in form.own_fields:
            self._old[f"old {name}"] = (name, 0)
            self._old |= {f"old {name},{'xyz'[axis]}": (name, 1 + axis) for axis in axes}

    def __getitem__(self, name: str) -> Array:
        """Its values, one per particle.

        Raises:
            InputError: The scene has no density, or no such data.
        """
        if name in self._made:
            return self._made[name]
        if name in self._position:
            return np.array(self._particles.x[:, self._position[name]])
        if name in self._old:
            field, column = self._old[name]
            return np.array(self._particles.carried(field)[:, column])
        if name == "old J":
            gradient = np.asarray(self._particles.displacement_gradient)
            return np.asarray(np.linalg.det(np.eye(gradient.shape[-1]) + gradient))
        if name == "rho":
            if self._density is None:
                raise InputError(
                    f"form {self._form.name} reads the density rho: expected Scene(..., density=...)"
                )
            return np.asarray(self._density[self._particles.material])
        if name not in dict(self._particles.arrays):
            raise InputError(
                f"form {self._form.name} reads the data '{name}' ({self._form.data.get(name, '')}), "
                f"which the scene does not have: expected scene.data('{name}', ...) before it is solved"
            )
        return np.array(self._particles.carried(name)[:, 0])

    def __iter__(self) -> Iterator[str]:
        return iter([*self._made, *self._position, *self._old, "rho", *self._form.data])

    def __len__(self) -> int:
        return len(list(iter(self)))
