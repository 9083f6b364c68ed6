"""Small scenes with known results; each function returns a relative error of a weak form.

References are the stress of a homogeneous deformation (Hencky's at finite strain), a bent beam in plane
strain (Timoshenko and Goodier), and eigenvalues of the Schur complement of the volume equation.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import scipy.linalg as la
from mpi4py import MPI

from tawami.base.arrays import Array
from tawami.base.errors import InputError, SingularError
from tawami.body.body import Body
from tawami.body.box import box
from tawami.check import trial
from tawami.check.trial import Law, Settings
from tawami.form.form import Form
from tawami.grid.basis import Basis
from tawami.grid.edges import Component
from tawami.grid.grid import EDGES, Geometry, Grid
from tawami.particles.laws import linear_elastic
from tawami.scene.scene import Scene

COMPONENTS: tuple[Component, ...] = ("x", "y")
K, MU = trial.K, 2.0
#: A displacement gradient that moves no particle out of the grid.
GRADIENT = np.array([[-0.05, 0.02], [0.01, -0.03]])
PRESSURE = 0.2
#: K/mu of the checks of volumetric locking.
RATIO = 1e4
#: Moduli (K, mu) at nu = 0.4999.
STIFF = (MU * 2 * 1.4999 / (3 * (1 - 2 * 0.4999)), MU)


def grid_of(
    cells: tuple[int, int],
    origin: tuple[float, float] = (0.0, 0.0),
    h: float = 0.5,
    geometry: Geometry = "plane_strain",
) -> Grid:
    """A grid on this rank alone."""
    return Grid(MPI.COMM_SELF, origin=origin, h=h, cells=cells, geometry=geometry)


def soil(form: Form, given: Settings) -> Law:
    """A plastic law whose flow changes the volume, if the form has a term for that."""
    laws = trial.PLASTIC
    return trial.law_of(form, laws[1:2] if preserves_volume(form, given) else laws)


def preserves_volume(form: Form, given: Settings) -> bool:
    """Whether the form serves only laws whose flow preserves the volume."""
    return form.kinematics.has_mean_stress and not trial.compiled(form, given).names("eps_p")


def cloud(
    form: Form,
    given: Settings,
    law: Law | None = None,
    geometry: Geometry = "plane_strain",
    **options: Any,
) -> Scene:
    """A scene of random particles of two materials, with random values of the user's fields."""
    random = np.random.default_rng(0)
    grid = grid_of((4, 3), geometry=geometry)
    x = grid.h * np.array(grid.cells) * random.random((60, 2))
    body = Body(x, random.uniform(0.005, 0.04, len(x)))
    elastic = [linear_elastic(E=2.0, nu=0.3), linear_elastic(E=7.0, nu=0.45)]
    chosen = law or trial.law_of(form, trial.ELASTIC)
    options |= {"material_of": random.integers(0, 2, len(x)), "varied": True}
    scene = trial.made(form, given, grid, body, [chosen(one) for one in elastic], **options)
    trial.at_random(scene)
    return scene


def path_difference(form: Form, given: Settings) -> float:
    """Difference of residual and tangent between the assembly at the points and that by dolfinx."""
    parts = []
    for path in ("points", "dolfinx"):
        scene = cloud(form, given, assembly=path)
        c = 0.4 * trial.spread(scene, np.random.default_rng(2))
        parts.append((scene.residual(c, dt=1.0), scene.tangent(c, dt=1.0).toarray()))
    errors = [np.abs(a - b).max() / np.abs(b).max() for a, b in zip(*parts, strict=True)]
    return float(max(errors))


def rigid_motion(form: Form, given: Settings, dt: float = 1.0) -> tuple[float, float]:
    """Largest force of a translation and of a rotation, divided by that of a stretch of the same size.

    The rotation is infinitesimal at small strain, and 1 rad at finite strain.

    Args:
        form: The form.
        given: Its parameters.
        dt: Length of the step [s].
    """
    scene = cloud(form, given)
    points = scene.configuration.domain.layout.greville - np.array(scene.grid.origin)
    turn = form.strain.rotation(1.0)
    stretch = _force(scene, 0.3 * points, dt)
    translation = _force(scene, np.ones_like(points) * [0.3, -0.2], dt)
    return translation / stretch, _force(scene, points @ turn.T, dt) / stretch


def _force(scene: Scene, u: Array, dt: float) -> float:
    """Largest force of a displacement of the coefficients, besides those at rest."""
    coefficients = np.zeros(scene.num_coefficients)
    rest = scene.residual(coefficients, dt=dt)
    coefficients[: u.size] = u.ravel()
    return float(np.abs(scene.residual(coefficients, dt=dt) - rest).max())


def axial_motion(form: Form, given: Settings) -> float:
    """Largest force of a translation along the axis of axisymmetry, divided by that of a stretch."""
    scene = cloud(form, given, geometry="axisymmetric")
    points = scene.configuration.domain.layout.greville
    along = _force(scene, np.ones_like(points) * [0.0, 0.3], trial.LONG)
    return along / _force(scene, 0.3 * points, trial.LONG)


def stretched_ring(form: Form, given: Settings) -> float:
    """Largest error of the uniform stress of a ring with u_r = a r and u_z = b z on its border."""
    grid = grid_of((4, 3), origin=(1.0, 0.0), geometry="axisymmetric")
    body = box(grid, grid.origin, grid.upper, per_axis=3, gauss=True)
    law = trial.law_of(form, trial.ELASTIC)(linear_elastic(K=K, mu=MU))
    scene = trial.made(form, given, grid, body, law, tolerance=1e-11)
    gradient = np.diag([-0.03, 0.01, -0.03])  # radial, axial, hoop
    for edge in EDGES:
        for axis, component in enumerate(COMPONENTS):
            scene.fix(edge, component, _linear(gradient[axis]))
    trial.solve(scene, dt=trial.LONG)
    return _error(scene, stress_of(form.strain.of_gradient(gradient)))


def filled(
    form: Form,
    given: Settings,
    basis: Basis = "quadratic_spline",
    rows: int = 3,
    moduli: tuple[float, float] = (K, MU),
) -> Scene:
    """Four columns and some rows of cells, three rows filled with particles at Gauss points."""
    grid = grid_of((4, rows))
    body = box(grid, (0, 0), (grid.upper[0], 3 * grid.h), per_axis=3, gauss=True)
    law = trial.law_of(form, trial.ELASTIC)(linear_elastic(K=moduli[0], mu=moduli[1]))
    return trial.made(form, given, grid, body, law, basis=basis, tolerance=1e-11)


def stress_of(strain: Array, K: float = K, MU: float = MU) -> Array:
    """Stress (xx, yy, zz, xy) of a (logarithmic) strain tensor in the plane or in space."""
    strain, volume = np.pad(strain, (0, 3 - len(strain))), np.trace(strain)
    stress = K * volume * np.eye(3) + 2 * MU * (strain - volume / 3 * np.eye(3))
    return np.append(np.diagonal(stress), stress[0, 1])


def _linear(slope: Array) -> Callable[[Array, Array], Array]:
    return lambda x, y: slope[0] * x + slope[1] * y


def displaced(
    form: Form, given: Settings, moduli: tuple[float, float] = (K, MU), size: float = 1.0
) -> float:
    """Largest error of the uniform stress under a linear displacement of the border.

    Args:
        form: The form.
        given: Its parameters.
        moduli: K and mu of the particles [Pa].
        size: Factor of the displacement gradient.
    """
    scene, gradient = filled(form, given, moduli=moduli), size * GRADIENT
    for edge in EDGES:
        for axis, component in enumerate(COMPONENTS):
            scene.fix(edge, component, _linear(gradient[axis]))
    trial.solve(scene, dt=trial.LONG)
    return _error(scene, stress_of(form.strain.of_gradient(gradient), *moduli))


def compressed(form: Form, given: Settings, basis: Basis, dt: float = trial.LONG) -> float:
    """Largest error of the uniform stress under a traction on an edge."""
    scene = filled(form, given, basis, rows=4)
    scene.fix("left", "x")
    scene.fix("bottom", "y")
    scene.traction("right", (-PRESSURE, 0.0))
    trial.solve(scene, dt=dt)
    # sigma_yy = 0; at finite strain sigma_xx / stretch_x, force over initial area, is prescribed
    ratio = -(K - 2 * MU / 3) / (K + 4 * MU / 3)
    modulus = K + 4 * MU / 3 + ratio * (K - 2 * MU / 3)
    along, finite = -PRESSURE / modulus, form.strain.finite
    for _ in range(100 if finite else 0):
        along = -PRESSURE * np.exp(along) / modulus
    return _error(scene, stress_of(np.diag([along, ratio * along])))


def _error(scene: Scene, exact: Array) -> float:
    return float(np.abs(scene.particles.stress - exact).max() / np.abs(exact).max())


def bent_beam(form: Form, given: Settings) -> float:
    """Error of the mean stress in a cantilever at K/mu = 1e4, in the mean square.

    16 x 8 cells of 2 x 2 particles, with tractions and root displacements of the exact solution, whose
    mean stress is sigma_m = (1 + nu)/3 P (L - x) y / I.
    """
    n, length, force = 8, 2.0, 1e-5
    grid = grid_of((2 * n, n), origin=(0.0, -0.5), h=1 / n)
    nu = (3 * RATIO - 2) / (2 * (3 * RATIO + 1))
    law = trial.law_of(form, trial.ELASTIC)(linear_elastic(K=RATIO, mu=1.0))
    modulus, nubar, inertia = (9 * RATIO / (3 * RATIO + 1)) / (1 - nu**2), nu / (1 - nu), 1 / 12
    scene = trial.made(form, given, grid, box(grid, (0, -0.5), (2, 0.5), per_axis=2), law)
    shear = 1.5 * force

    def root(x: Array, y: Array) -> Array:
        return (2 + nubar) * force * y * (y**2 - 0.25) / (6 * modulus * inertia)

    scene.fix("left", "x", root)
    scene.hold((0.0, 0.0), "y")
    scene.traction("left", (0.0, lambda x, y: shear * (1 - 4 * y**2)))
    scene.traction("right", (0.0, lambda x, y: -shear * (1 - 4 * y**2)))
    x = np.array(scene.particles.x)
    exact = (1 + nu) / 3 * force * (length - x[:, 0]) * x[:, 1] / inertia
    error = trial.solve(scene, dt=trial.LONG).mean_stress - exact
    return float(np.linalg.norm(error) / np.linalg.norm(exact))


def inf_sup(form: Form, given: Settings, basis: Basis = "quadratic_spline") -> float:
    """Inf-sup constant of a filled block that is held all around.

    This is the root of the smallest eigenvalue of S p = lambda M p / mu, except that of constants, with
    the sign of the eigenvalue. S is the Schur complement of the volume equation in p.

    Raises:
        InputError: The form has no field for the volume.
        SingularError: The form does not resist a change of shape.
    """
    if form.volume_field is None:
        raise InputError(f"form {form.name} has no field for the volume")
    n = 6
    grid = grid_of((n, n), h=1 / n)
    body = box(grid, (0, 0), (1, 1), per_axis=3, gauss=True)
    law = trial.law_of(form, trial.ELASTIC)(linear_elastic(K=RATIO, mu=1.0))
    scene = trial.made(form, given, grid, body, law, basis=basis)
    for edge in EDGES:
        scene.fix(edge, "x")
        scene.fix(edge, "y")
    selection = scene.reduction().selection
    unknowns = scene.reduction().coefficients
    at_rest = scene.tangent(np.zeros(scene.num_coefficients), dt=trial.LONG)
    tangent = (selection.T @ at_rest @ selection).toarray()
    of_u = unknowns < scene.configuration.domain.layout.num_displacement
    A, B = tangent[of_u][:, of_u], tangent[~of_u][:, of_u]
    # the unknown is p = K eps_v, and the equation of the volume is divided by K
    to_p = RATIO if form.kinematics.has_eps_v else 1.0
    try:
        lifted = np.linalg.solve(A, tangent[of_u][:, ~of_u])
    except np.linalg.LinAlgError:
        raise SingularError(
            f"form {form.name}: displacements of a block that is held all around are free: expected a "
            "term of the deviator, such as sum_p(sigma, grad(w))"
        ) from None
    schur = B @ lifted - tangent[~of_u][:, ~of_u]
    schur = (schur + schur.T) / (2 * to_p**2)
    neighbours = np.eye(n + 1, k=1) + np.eye(n + 1, k=-1)
    line = grid.h / 6 * (np.diag([2.0, *[4.0] * (n - 1), 2.0]) + neighbours)
    mass = np.kron(line, line)
    values, vectors = la.eigh(schur, mass)
    # a constant pressure does no work in a block that is held all around
    constant = np.abs(vectors.T @ mass @ np.ones(len(mass)))
    least = float(np.delete(values, int(np.argmax(constant)))[0])
    return float(np.sign(least) * np.sqrt(abs(least)))
