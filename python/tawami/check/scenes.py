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

from tawami import _rust
from tawami.base.arrays import Array
from tawami.base.errors import InputError, SingularError
from tawami.body.body import Body
from tawami.body.box import box
from tawami.form.compilation import compile_form
from tawami.form.form import Form
from tawami.grid.basis import Basis
from tawami.grid.edges import Component
from tawami.grid.grid import EDGES, Geometry, Grid
from tawami.particles.laws import drucker_prager, linear_elastic, von_mises
from tawami.scene.scene import Scene

Settings = dict[str, Any]
Law = Callable[[_rust.Material], _rust.Material]

COMPONENTS: tuple[Component, ...] = ("x", "y")
K, MU = 5.0, 2.0
#: A displacement gradient that moves no particle out of the grid.
GRADIENT = np.array([[-0.05, 0.02], [0.01, -0.03]])
PRESSURE = 0.2
#: K/mu of the checks of volumetric locking.
RATIO = 1e4


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
    if preserves_volume(form, given):
        return lambda elastic: von_mises(elastic, yield_stress=0.1, hardening=0.1)
    return lambda elastic: drucker_prager(elastic, phi=20.0, c=0.05, psi=10.0)


def preserves_volume(form: Form, given: Settings) -> bool:
    """Whether the form serves only laws whose flow preserves the volume."""
    compiled = compile_form(MPI.COMM_SELF, form, form.settings(given)[1])
    return form.kinematics.has_mean_stress and not compiled.names("eps_p")


def cloud(
    form: Form,
    given: Settings,
    law: Law | None = None,
    geometry: Geometry = "plane_strain",
    **options: Any,
) -> Scene:
    """A scene of random particles of two materials."""
    random = np.random.default_rng(0)
    grid = grid_of((4, 3), geometry=geometry)
    x = grid.h * np.array(grid.cells) * random.random((60, 2))
    body = Body(x, random.uniform(0.01, 0.1, len(x)))
    elastic = [linear_elastic(E=2.0, nu=0.3), linear_elastic(E=7.0, nu=0.45)]
    materials = elastic if law is None else [law(one) for one in elastic]
    return Scene(
        grid,
        body,
        materials,
        material_of=random.integers(0, 2, len(x)),
        form=form,
        **options,
        **given,
    )


def tangent_error(scene: Scene) -> float:
    """Error of the tangent in a direction, compared with central differences of the residual.

    It is the smaller error of two step sizes, because particles may change between elastic and plastic
    within one of them.
    """
    random = np.random.default_rng(1)
    c, direction = 0.05 * scene.grid.h * random.standard_normal((2, scene.num_coefficients))
    predicted, errors = scene.tangent(c) @ direction, []
    for step in (1e-4, 3e-5):
        ahead, behind = (scene.residual(c + sign * step * direction) for sign in (1, -1))
        difference = (ahead - behind) / (2 * step)
        errors.append(np.abs(difference - predicted).max() / np.abs(predicted).max())
    return float(min(errors))


def path_difference(form: Form, given: Settings) -> float:
    """Difference of residual and tangent between the assembly at the points and that by dolfinx."""
    parts = []
    for path in ("points", "dolfinx"):
        scene = cloud(form, given, assembly=path)
        c = 0.02 * scene.grid.h * np.random.default_rng(2).standard_normal(scene.num_coefficients)
        parts.append((scene.residual(c), scene.tangent(c).toarray()))
    errors = [np.abs(a - b).max() / np.abs(b).max() for a, b in zip(*parts, strict=True)]
    return float(max(errors))


def rigid_motion(form: Form, given: Settings) -> float:
    """Largest force of a translation and of a rotation, divided by that of a stretch of the same size.

    The rotation is infinitesimal at small strain, and 1 rad at finite strain.
    """
    scene = cloud(form, given)
    points = scene.configuration.domain.layout.greville - np.array(scene.grid.origin)
    turn = form.strain.rotation(1.0)

    def force(u: Array) -> float:
        coefficients = np.zeros(scene.num_coefficients)
        coefficients[: u.size] = u.ravel()
        return float(np.abs(scene.residual(coefficients)).max())

    rigid = (np.ones_like(points) * [0.3, -0.2], points @ turn.T)
    return max(map(force, rigid)) / force(0.3 * points)


def axial_motion(form: Form, given: Settings) -> float:
    """Largest force of a translation along the axis of axisymmetry, divided by that of a stretch."""
    scene = cloud(form, given, geometry="axisymmetric")
    points = scene.configuration.domain.layout.greville

    def force(u: Array) -> float:
        coefficients = np.zeros(scene.num_coefficients)
        coefficients[: u.size] = u.ravel()
        return float(np.abs(scene.residual(coefficients)).max())

    return force(np.ones_like(points) * [0.0, 0.3]) / force(0.3 * points)


def stretched_ring(form: Form, given: Settings) -> float:
    """Largest error of the uniform stress of a ring with u_r = a r and u_z = b z on its border."""
    grid = grid_of((4, 3), origin=(1.0, 0.0), geometry="axisymmetric")
    body = box(grid, grid.origin, grid.upper, per_axis=3, gauss=True)
    law = linear_elastic(K=K, mu=MU)
    scene = Scene(grid, body, law, form=form, tolerance=1e-11, **given)
    gradient = np.diag([-0.03, 0.01, -0.03])  # radial, axial, hoop
    for edge in EDGES:
        for axis, component in enumerate(COMPONENTS):
            scene.fix(edge, component, _linear(gradient[axis]))
    scene.solve()
    return _error(scene, stress_of(form.strain.of_gradient(gradient)))


def _filled(form: Form, given: Settings, basis: Basis = "quadratic_spline", rows: int = 3) -> Scene:
    """Four columns and some rows of cells, three rows filled with particles at Gauss points."""
    grid = grid_of((4, rows))
    body = box(grid, (0, 0), (grid.upper[0], 3 * grid.h), per_axis=3, gauss=True)
    law = linear_elastic(K=K, mu=MU)
    return Scene(grid, body, law, form=form, basis=basis, tolerance=1e-11, **given)


def stress_of(strain: Array) -> Array:
    """Stress (xx, yy, zz, xy) of a (logarithmic) strain tensor in the plane or in space."""
    strain, volume = np.pad(strain, (0, 3 - len(strain))), np.trace(strain)
    stress = K * volume * np.eye(3) + 2 * MU * (strain - volume / 3 * np.eye(3))
    return np.append(np.diagonal(stress), stress[0, 1])


def _linear(slope: Array) -> Callable[[Array, Array], Array]:
    return lambda x, y: slope[0] * x + slope[1] * y


def displaced(form: Form, given: Settings) -> float:
    """Largest error of the uniform stress under a linear displacement of the border."""
    scene = _filled(form, given)
    for edge in EDGES:
        for axis, component in enumerate(COMPONENTS):
            scene.fix(edge, component, _linear(GRADIENT[axis]))
    scene.solve()
    return _error(scene, stress_of(form.strain.of_gradient(GRADIENT)))


def compressed(form: Form, given: Settings, basis: Basis) -> float:
    """Largest error of the uniform stress under a traction on an edge."""
    scene = _filled(form, given, basis, rows=4)
    scene.fix("left", "x")
    scene.fix("bottom", "y")
    scene.traction("right", (-PRESSURE, 0.0))
    scene.solve()
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
    law = linear_elastic(K=RATIO, mu=1.0)
    modulus, nubar, inertia = (9 * RATIO / (3 * RATIO + 1)) / (1 - nu**2), nu / (1 - nu), 1 / 12
    scene = Scene(grid, box(grid, (0, -0.5), (2, 0.5), per_axis=2), law, form=form, **given)
    shear = 1.5 * force

    def root(x: Array, y: Array) -> Array:
        return (2 + nubar) * force * y * (y**2 - 0.25) / (6 * modulus * inertia)

    scene.fix("left", "x", root)
    scene.hold((0.0, 0.0), "y")
    scene.traction("left", (0.0, lambda x, y: shear * (1 - 4 * y**2)))
    scene.traction("right", (0.0, lambda x, y: -shear * (1 - 4 * y**2)))
    x = np.array(scene.particles.x)
    exact = (1 + nu) / 3 * force * (length - x[:, 0]) * x[:, 1] / inertia
    error = scene.solve().mean_stress - exact
    return float(np.linalg.norm(error) / np.linalg.norm(exact))


def inf_sup(form: Form, given: Settings) -> float:
    """Inf-sup constant of a filled block that is held all around.

    This is the root of the smallest eigenvalue of S p = lambda M p / mu, except that of constants, with
    the sign of the eigenvalue. S is the Schur complement of the volume equation in p.

    Raises:
        InputError: The form has no field for the volume.
        SingularError: The form does not resist a change of shape.
    """
    if len(form.fields) == 1:
        raise InputError(f"form {form.name} has no field for the volume")
    n = 6
    grid = grid_of((n, n), h=1 / n)
    body = box(grid, (0, 0), (1, 1), per_axis=3, gauss=True)
    scene = Scene(grid, body, linear_elastic(K=RATIO, mu=1.0), form=form, **given)
    for edge in EDGES:
        scene.fix(edge, "x")
        scene.fix(edge, "y")
    selection = scene.reduction().selection
    unknowns = scene.reduction().unknowns
    tangent = (selection.T @ scene.tangent(np.zeros(scene.num_coefficients)) @ selection).toarray()
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
