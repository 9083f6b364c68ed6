"""Dynamics: Newmark's method on the grid, and the transfers between particles and grid.

Momentum is mapped with the lumped mass m_i = sum_p N_i m_p, x_i the Greville point of the spline:

    (m v)_i = sum_p N_i m_p (v_p + C_p (x_i - x_p)),   likewise a with its gradient
    a1 = (u - dt v - dt^2 (1/2 - beta) a) / (beta dt^2),   v1 = v + dt ((1 - gamma) a + gamma a1)

and after the solve

    a_p = sum_i N_i a1_i     C_p = grad v1 f^-1     v_p += sum_i N_i (v1_i - v_i)      (FLIP)
                                                    v_p  = sum_i N_i v1_i              (PIC)

v_i is the mapped value before supports are imposed, so that their impulse reaches the particles.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from tawami import _rust, inputs
from tawami.errors import ConvergenceError, InputError, SingularError
from tawami.newton import Inertia
from tawami.scene import Scene, Solution

Array = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]
Transfer = Literal["affine_flip", "flip", "tpic", "pic"]
#: Whether a transfer maps the gradient of the velocity, and whether it adds the grid's change.
TRANSFERS: dict[str, tuple[bool, bool]] = {
    "affine_flip": (True, True),
    "flip": (False, True),
    "tpic": (True, False),
    "pic": (False, False),
}


class Dynamics:
    """Motion of the particles of a scene with a form of finite strain and a density.

    Args:
        scene: The scene, its supports along edges, held at zero for now, and its weight.
        velocity: Velocities at the start [m/s]: one for all particles, or particles x 2.
        transfer: 'affine_flip', 'flip', 'tpic' or 'pic'.
        damping: Time in which velocities of FLIP relax towards those of PIC [s]: per step a share
            1 - exp(-dt/damping) of the difference goes; infinite for none.
        gamma: Newmark's; 1/2 is the trapezoidal rule, more damps. beta = (gamma + 1/2)^2 / 4.

    Attributes:
        velocity: v_p [m/s], particles x 2.
        acceleration: a_p [m/s2], particles x 2.
        velocity_gradient: C_p [1/s], particles x 2 x 2.
        mass: m_p [kg per metre depth].
        time: [s]
        steps: Number of steps accepted.

    Raises:
        InputError: A scene without density or of small strain, or a parameter out of its range.
    """

    def __init__(
        self,
        scene: Scene,
        *,
        velocity: npt.ArrayLike = (0.0, 0.0),
        transfer: Transfer = "affine_flip",
        damping: float = np.inf,
        gamma: float = 0.5,
    ) -> None:
        if scene.form.strain != "finite" or scene._density is None:
            raise InputError(
                "Dynamics needs a form of finite strain, as 'u_epsv_finite', and "
                "Scene(..., density=...) [kg/m3]"
            )
        if transfer not in TRANSFERS:
            raise InputError(f"transfer = {transfer!r}: expected one of {', '.join(TRANSFERS)}")
        if scene.basis == "biquadratic":
            raise InputError(
                "Dynamics with the basis 'biquadratic': its lumped masses are not all positive; use "
                "'quadratic_spline'"
            )
        if not scene._density.min() > 0:
            raise InputError(
                "Dynamics: a density of 0: expected more than 0 kg/m3 for every material"
            )
        if not isinstance(damping, (int, float)) or not damping > 0:
            raise InputError(f"damping = {damping!r}: expected a time in s, more than 0")
        self.gamma = inputs.number("gamma", gamma, low=0.5, high=1.0)
        self.beta = (self.gamma + 0.5) ** 2 / 4
        self.scene, self.transfer, self.damping = scene, transfer, float(damping)
        n = len(scene.particles)
        try:
            self.velocity = np.array(np.broadcast_to(np.asarray(velocity, dtype=float), (n, 2)))
        except ValueError:
            raise InputError(
                f"velocity has shape {np.shape(velocity)}: expected two numbers, or {n} x 2"
            ) from None
        self.mass = scene._density * scene.particles.volume
        self.acceleration, self.velocity_gradient = np.zeros((n, 2)), np.zeros((n, 2, 2))
        self._acceleration_gradient = np.zeros((n, 2, 2))
        self.time, self.steps = 0.0, 0

    # -- one step ------------------------------------------------------------

    def step(self, dt: float) -> Solution:
        """One step of `dt` seconds; if it fails nothing has changed.

        Raises:
            ConvergenceError, SingularError: As `Scene.solve`.
            InputError: dt, or what is not finite, or a particle that would leave the grid.
        """
        dt = inputs.number("dt", dt, low=sys.float_info.min)
        scene = self.scene
        scene.particles.check()
        if scene._points or scene._tractions:
            raise InputError(
                "Dynamics knows supports along edges and weight so far: expected a scene without "
                "hold(...) and traction(...)"
            )
        for name in ("velocity", "acceleration", "velocity_gradient"):
            values = getattr(self, name).reshape(len(self.mass), -1)
            bad = np.flatnonzero(~np.isfinite(values).all(axis=1))
            if len(bad):
                raise InputError(
                    f"{name} of {len(bad)} particles is not finite, the first is {bad[0]}, at "
                    f"{self.time:g} s"
                )
        location, basis = scene._location, scene.basis
        reduction, external = scene._reduction(moving=True), scene._external()
        if reduction.offset.any():
            raise InputError(
                "Dynamics holds edges at zero so far: expected fix(edge, component) without a value"
            )
        n = scene._field.layout.num_displacement
        mass = self._sums(np.ones((len(self.mass), 1)))[:, 0]
        held = np.ones(n, dtype=bool)
        held[reduction.unknowns[reduction.unknowns < n]] = False
        acceleration = self.acceleration
        if self.steps == 0:
            acceleration = self._first_acceleration(external, mass, held)
        mapped_v = self._mapped(self.velocity, self.velocity_gradient, mass)
        mapped_a = self._mapped(acceleration, self._acceleration_gradient, mass)
        v, a = mapped_v.copy(), mapped_a.copy()
        v.ravel()[held] = a.ravel()[held] = 0.0

        slope = 1 / (self.beta * dt**2)
        offset = slope * (dt * v + dt**2 * (0.5 - self.beta) * a)
        inertia = Inertia(np.repeat(mass, 2), slope, offset.ravel())

        def also(u: Array) -> Callable[[], None]:
            a1 = inertia.acceleration(u).reshape(-1, 2)
            v1 = v + dt * ((1 - self.gamma) * a + self.gamma * a1)
            v1.ravel()[held] = a1.ravel()[held] = 0.0
            found = self._returned(location, basis, u, mapped_v, v1, a1, dt)
            found |= {"time": self.time + dt, "steps": self.steps + 1}

            def store() -> None:
                for name, value in found.items():
                    setattr(self, name, value)

            return store

        return scene._advance(reduction, external, inertia, self._guess(dt * v), also)

    def _sums(self, data: Array) -> Array:
        """sum_p m_p D_p N_i."""
        scene = self.scene
        return _rust.nodal_sums(scene._location, self.mass, data, scene.basis)

    def _mapped(self, values: Array, gradient: Array, mass: Array) -> Array:
        """Velocity or acceleration of the grid from that of the particles: functions x 2."""
        affine, _ = TRANSFERS[self.transfer]
        scene = self.scene
        if affine:
            x = np.array(scene.particles.x) - scene.grid.origin
            data = np.column_stack(
                [values - np.einsum("pij,pj->pi", gradient, x), gradient.reshape(-1, 4)]
            )
            sums = self._sums(data)
            points = scene._field.layout.greville - scene.grid.origin
            momentum = sums[:, :2] + np.einsum("ikl,il->ik", sums[:, 2:].reshape(-1, 2, 2), points)
        else:
            momentum = self._sums(values)
        return _over(momentum, mass[:, None])

    def _first_acceleration(self, external: Array, mass: Array, held: Mask) -> Array:
        """Accelerations of the particles from the momentum equation: g in free fall, 0 in rest."""
        scene = self.scene
        n = scene._field.layout.num_displacement
        internal = scene._newton.internal(np.zeros(scene.num_coefficients))
        force = (external - internal)[:n].reshape(-1, 2)
        a = _over(force, mass[:, None])
        a.ravel()[held] = 0.0
        return _rust.interpolate(scene._location, scene.basis, 2, a.ravel())

    def _guess(self, u: Array) -> Array:
        """u = dt v, eps_v the lumped projection of its ln det f."""
        scene = self.scene
        guess = np.zeros(scene.num_coefficients)
        n = scene._field.layout.num_displacement
        guess[:n] = u.ravel()
        if len(guess) > n:
            ln_j = scene._stage.volume_strains(guess[:n], None)[:, 0]
            weight = scene._constants["K"] * scene.particles.volume
            # a guess that halves a particle or turns it inside out is not followed that far
            data = np.column_stack([np.fmax(ln_j, np.log(0.5)), np.ones(len(weight))])
            sums = _rust.nodal_sums(scene._location, weight, data, "bilinear")
            guess[n:] = _over(sums[:, 0], sums[:, 1])
        return guess

    def _returned(
        self, location: _rust.Location, basis: str, u: Array, before: Array, v1: Array, a1: Array,
        dt: float,
    ) -> dict[str, Any]:  # fmt: skip
        """From the grid of the step back to the particles: their new arrays by name."""

        def at_particles(values: Array) -> Array:
            return _rust.interpolate(location, basis, 2, np.ascontiguousarray(values).ravel())

        affine, flip = TRANSFERS[self.transfer]
        velocity = pic = at_particles(v1)
        if flip:
            moved = self.velocity + at_particles(v1 - before)
            velocity = pic + np.exp(-dt / self.damping) * (moved - pic)
        found: dict[str, Any] = {"velocity": velocity, "acceleration": at_particles(a1)}
        if affine:
            f = np.eye(2) + _rust.gradients(location, basis, u).reshape(-1, 2, 2)
            inverse = np.linalg.inv(f)
            for name, field in (("velocity_gradient", v1), ("_acceleration_gradient", a1)):
                gradient = _rust.gradients(location, basis, np.ascontiguousarray(field).ravel())
                found[name] = gradient.reshape(-1, 2, 2) @ inverse
        return found

    # -- many steps ----------------------------------------------------------

    def run(self, end: float, dt: float, *, smallest: float | None = None) -> list[Solution]:
        """Steps until `end` [s]; one that fails is halved, and the size grows again after three.

        Args:
            end: Time of the end [s].
            dt: Size of a step [s].
            smallest: Size below which the run ends [s]; dt/1024 by default.

        Returns:
            The accepted steps.

        Raises:
            ConvergenceError, SingularError: At the smallest step, with its history; what was accepted
                is in the particles.
            InputError: dt <= 0, or a step longer than the time that is left.
        """
        dt = inputs.number("dt", dt, low=sys.float_info.min)
        left = inputs.number("end", end) - self.time
        if dt > left * (1 + 1e-9):
            raise InputError(
                f"dt = {dt:g} s is longer than the {left:g} s until end = {end:g} s: expected a shorter "
                "step"
            )
        smallest = dt / 1024 if smallest is None else inputs.number("smallest", smallest, low=0.0)
        size, good, accepted = dt, 0, []
        while end - self.time > 1e-9 * dt:
            now = min(size, end - self.time)
            try:
                accepted.append(self.step(now))
            except (ConvergenceError, SingularError) as error:
                size, good = now / 2, 0
                if size < smallest:
                    error.add_note(f"at {self.time:g} s, with the smallest step of {now:g} s")
                    raise
                continue
            good += 1
            if good >= 3 and size < dt:
                size, good = min(2 * size, dt), 0
        return accepted

    # -- what is conserved ---------------------------------------------------

    @property
    def linear_momentum(self) -> Array:
        """sum m v [kg m/s per metre depth]."""
        return np.asarray(self.mass @ self.velocity)

    def angular_momentum(self, about: Sequence[float] = (0.0, 0.0)) -> float:
        """sum m (x - about) x v [kg m2/s per metre depth], the part of the affine velocity fields, which
        is of the size of a particle, left out.
        """
        x = np.array(self.scene.particles.x) - np.asarray(about)
        return float(self.mass @ (x[:, 0] * self.velocity[:, 1] - x[:, 1] * self.velocity[:, 0]))

    @property
    def kinetic_energy(self) -> float:
        """1/2 sum m v^2 [J per metre depth]."""
        return float(0.5 * self.mass @ (self.velocity**2).sum(axis=1))


def _over(sums: Array, weights: Array) -> Array:
    """Means from weighted sums; 0 for functions without particles."""
    return np.asarray(np.divide(sums, weights, out=np.zeros_like(sums), where=weights > 0))
