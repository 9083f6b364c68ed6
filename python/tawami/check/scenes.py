"""Small scenes that show whether a weak form is right; each gives a relative error.

Closed forms: the stress of a homogeneous deformation (Hencky's at finite strain), a bent beam in plane
strain (Timoshenko and Goodier), the eigenvalues of the Schur complement of the volume equation.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy.linalg as la
from mpi4py import MPI

from tawami import _rust
from tawami.base.errors import InputError, SingularError
from tawami.body.body import Body
from tawami.body.box import box
from tawami.form.form import Form
from tawami.grid.basis import Basis
from tawami.grid.edges import Component
from tawami.grid.grid import EDGES, Grid
from tawami.particles.laws import drucker_prager, linear_elastic, von_mises
from tawami.scene.scene import Scene

Array = npt.NDArray[np.float64]
Settings = dict[str, Any]
Law = Callable[[_rust.Material], _rust.Material]

COMPONENTS: tuple[Component, ...] = ("x", "y")
K, MU = 5.0, 2.0
#: Inwards, so that no particle leaves the grid.
GRADIENT = np.array([[-0.05, 0.02], [0.01, -0.03]])
PRESSURE = 0.2
#: Where volumetric locking shows.
RATIO = 1e4


def grid_of(
    cells: tuple[int, int], origin: tuple[float, float] = (0.0, 0.0), h: float = 0.5
) -> Grid:
    """A grid of this rank alone."""
    return Grid(MPI.COMM_SELF, origin=origin, h=h, cells=cells)


def soil(form: Form) -> Law:
    """A plastic law: one that couples mean stress and shear where the form can take it."""
    if form.kinematics.deviatoric:
        return lambda elastic: von_mises(elastic, yield_stress=0.1, hardening=0.1)
    return lambda elastic: drucker_prager(elastic, phi=20.0, c=0.05, psi=10.0)


def cloud(form: Form, given: Settings, law: Law | None = None, **options: Any) -> Scene:
    """Particles at random, of two materials."""
    random = np.random.default_rng(0)
    grid = grid_of((4, 3))
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
    """Tangent times a direction against central differences of the residual: the smaller error of two
    steps, because a particle may change between elastic and plastic in one.
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
    """Residual and tangent by kernels in Rust against those by dolfinx."""
    parts = []
    for path in ("fast", "reference"):
        scene = cloud(form, given, assembly=path)
        c = 0.02 * scene.grid.h * np.random.default_rng(2).standard_normal(scene.num_coefficients)
        parts.append((scene.residual(c), scene.tangent(c).toarray()))
    errors = [np.abs(a - b).max() / np.abs(b).max() for a, b in zip(*parts, strict=True)]
    return float(max(errors))


def rigid_motion(form: Form, given: Settings) -> float:
    """Largest force of a translation and of a rotation (at finite strain by 1 rad), over that of a
    stretch of the same size.
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


def _filled(form: Form, given: Settings, basis: Basis = "quadratic_spline", rows: int = 3) -> Scene:
    """Four columns and some rows of cells with particles at their Gauss points, three rows filled."""
    grid = grid_of((4, rows))
    body = box(grid, (0, 0), (grid.upper[0], 3 * grid.h), per_axis=3, gauss=True)
    law = linear_elastic(K=K, mu=MU)
    return Scene(grid, body, law, form=form, basis=basis, tolerance=1e-11, **given)


def stress_of(strain: Array) -> Array:
    """Stress (xx, yy, zz, xy) of a (logarithmic) strain tensor in the plane."""
    volume = np.trace(strain)
    stress = K * volume + 2 * MU * (np.array([strain[0, 0], strain[1, 1], 0.0]) - volume / 3)
    return np.append(stress, 2 * MU * strain[0, 1])


def _linear(slope: Array) -> Callable[[Array, Array], Array]:
    return lambda x, y: slope[0] * x + slope[1] * y


def displaced(form: Form, given: Settings) -> float:
    """A border displaced linearly gives one stress everywhere: largest error of it."""
    scene = _filled(form, given)
    for edge in EDGES:
        for axis, component in enumerate(COMPONENTS):
            scene.fix(edge, component, _linear(GRADIENT[axis]))
    scene.solve()
    return _error(scene, stress_of(form.strain.of_gradient(GRADIENT)))


def compressed(form: Form, given: Settings, basis: Basis) -> float:
    """A traction on an edge gives one stress everywhere: largest error of it."""
    scene = _filled(form, given, basis, rows=4)
    scene.fix("left", "x")
    scene.fix("bottom", "y")
    scene.traction("right", (-PRESSURE, 0.0))
    scene.solve()
    # sigma_yy = 0; at finite strain sigma_xx / stretch_x, the force over the area at the start, is given
    ratio = -(K - 2 * MU / 3) / (K + 4 * MU / 3)
    modulus = K + 4 * MU / 3 + ratio * (K - 2 * MU / 3)
    along, finite = -PRESSURE / modulus, form.strain.finite
    for _ in range(100 if finite else 0):
        along = -PRESSURE * np.exp(along) / modulus
    return _error(scene, stress_of(np.diag([along, ratio * along])))


def _error(scene: Scene, exact: Array) -> float:
    return float(np.abs(scene.particles.stress - exact).max() / np.abs(exact).max())


def bent_beam(form: Form, given: Settings) -> float:
    """Mean stress in a cantilever of 16 x 8 cells of 2 x 2 particles at K/mu = 1e4, in the mean square.

    sigma_m = (1 + nu)/3 P (L - x) y / I with the tractions and root displacements of that solution.
    """
    n, length, force = 8, 2.0, 1e-5
    grid = grid_of((2 * n, n), origin=(0.0, -0.5), h=1 / n)
    nu = (3 * RATIO - 2) / (2 * (3 * RATIO + 1))
    law = linear_elastic(K=RATIO, mu=1.0)
    modulus, nubar, inertia = (9 * RATIO / (3 * RATIO + 1)) / (1 - nu**2), nu / (1 - nu), 1 / 12
    scene = Scene(grid, box(grid, (0, -0.5), (2, 0.5)), law, form=form, **given)
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
    """Inf-sup constant of a filled block, held all around: the root of the smallest eigenvalue, that of
    constants apart, of S p = lambda M p / mu, S the Schur complement of the volume equation in p; with
    the sign of the eigenvalue.

    Raises:
        InputError: A form without a field for the volume.
        SingularError: One that does not resist a change of shape.
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
    # in p = K eps_v, and each equation of the volume without its K
    to_p = RATIO if form.kinematics.has_eps_v else 1.0
    try:
        lifted = np.linalg.solve(A, tangent[of_u][:, ~of_u])
    except np.linalg.LinAlgError:
        raise SingularError(
            f"form {form.name}: displacements of a block that is held all around are free: expected a "
            "term of the deviator, as sum_p(sigma, grad(w)) has it"
        ) from None
    schur = B @ lifted - tangent[~of_u][:, ~of_u]
    schur = (schur + schur.T) / (2 * to_p**2)
    neighbours = np.eye(n + 1, k=1) + np.eye(n + 1, k=-1)
    line = grid.h / 6 * (np.diag([2.0, *[4.0] * (n - 1), 2.0]) + neighbours)
    mass = np.kron(line, line)
    values, vectors = la.eigh(schur, mass)
    # the constant pressure is the one vector that no boundary lets work
    constant = np.abs(vectors.T @ mass @ np.ones(len(mass)))
    least = float(np.delete(values, int(np.argmax(constant)))[0])
    return float(np.sign(least) * np.sqrt(abs(least)))
