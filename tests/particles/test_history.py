"""History variables of the laws at the end of a step, as quantities of a weak form."""

from __future__ import annotations

import numpy as np
import pytest
from numpy_laws import stiffening, von_mises
from scenes import grid_of

import tawami
from tawami import _rust
from tawami.base.timing import Stopwatch
from tawami.domain.domain import Domain

K, MU = 5e3, 1e3
STIFFENING = stiffening(K, MU)
SAND = tawami.drucker_prager(
    tawami.linear_elastic(K=K, mu=MU), phi=30.0, c=5.0, psi=10.0, eps_v_max=10.0
)


def work(strain, stress, history):
    """Nonlinear elasticity that counts the work of the mean of old and new stress."""
    new, tangent = STIFFENING.respond(strain, stress)
    done = 0.5 * ((new + stress) * strain).sum(axis=1)
    return new, tangent, {"work": history["work"] + done}


WORK = tawami.NumpyLaw(work, K, MU, history=("work",))
LAWS = {
    "sand": SAND,
    "steel": von_mises(K, MU, 30.0, 200.0),
    "without tangent": von_mises(K, MU, 30.0, 200.0, tangent=False),
    "work": WORK,
}


def domain_of(law, form):
    """Particles under stress that have history."""
    grid = grid_of()
    body = tawami.box(grid, grid.origin, grid.upper, per_axis=2)
    other = tawami.linear_elastic(K=K, mu=MU)  # without the variable
    scene = tawami.Scene(
        grid, body, [law, other], material_of=np.arange(len(body.x)) % 2, form=form
    )
    domain = scene.configuration.domain
    random = np.random.default_rng(1)
    domain.particles.stress[:] = 10.0 * random.standard_normal(domain.particles.stress.shape)
    domain.particles.stress[:, :3] -= 40.0
    for name in domain.particles.history_names:
        domain.particles.history(name)[::2] = 1e-3
    return scene, domain


def values(domain, c, name, *parts):
    """The value of a variable, or its derivatives side by side."""
    data = np.full((len(domain.particles), 6), np.nan)
    widths = {"value": 1, "volume": 1, "strain": 3, "gradient": 4}
    requests, first = [], 0
    for part in parts:
        requests.append((f"history:{name}", part, first, None))
        first += widths[part]
    domain.stage.evaluate(*domain.layout.split(c), _rust.Requests([requests]), [data])
    return data[:, :first]


def committed(scene, domain, c, name):
    """A variable after a step with these increments; the particles stay as they are."""
    copy = domain.particles.select(np.arange(len(domain.particles), dtype=np.uint32))
    after = Domain.attach(domain.model, copy, domain.location, scene.numerics, Stopwatch())
    after.stage.commit(*domain.layout.split(c))
    return copy.history(name)


def changes(domain, c, d):
    """Changes of the strain or gradient and of the volume at the particles, in a direction d."""
    kinematics, space = domain.model.form.kinematics, domain.model.space
    (u, _), (du, dv) = (domain.layout.split(part) for part in (c, d))
    x = np.asarray(domain.particles.x)
    h, origin = domain.model.grid.h, domain.model.grid.origin
    centres = domain.model.grid.rust.locate(origin + h * (np.floor((x - origin) / h) + 0.5))
    basis = domain.layout.basis

    def gradient(location, field):
        return space.tensors(np.asarray(_rust.gradients(location, basis, field)))

    g = gradient(domain.location, du)
    if dv is not None:
        volume = np.asarray(_rust.interpolate(domain.location, "bilinear", 1, dv))[:, 0]
    elif not kinematics.volume_at_centre:
        volume = np.zeros(len(g))
    else:
        f = np.eye(2) + (gradient(centres, u) if domain.model.form.strain.finite else 0.0)
        volume = np.trace(np.linalg.solve(f, gradient(centres, du)), axis1=1, axis2=2)
    if domain.model.form.strain.finite:
        return g.reshape(-1, 4), volume
    return np.column_stack([g[:, 0, 0], g[:, 1, 1], g[:, 0, 1] + g[:, 1, 0]]), volume


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize(
    "form", ["u", "u_bbar", "u_epsv", "u_p", "u_finite", "u_bbar_finite", "u_epsv_finite"]
)
def test_value_and_derivatives_are_those_of_committed_steps(form, law):
    scene, domain = domain_of(LAWS[law], form)
    name = domain.particles.history_names[-1]
    random = np.random.default_rng(0)
    size = np.where(np.arange(domain.layout.size) < domain.layout.num_displacement, 0.02, 0.01)
    if form == "u_p":
        size[domain.layout.num_displacement :] = 10.0
    c, d = size * random.standard_normal((2, domain.layout.size))
    value = values(domain, c, name, "value")[:, 0]
    np.testing.assert_allclose(value[::2], committed(scene, domain, c, name)[::2], rtol=1e-13)
    assert (value[1::2] == 0).all()
    assert (value[::2] != 1e-3).any()
    h = 1e-5
    less, more = (committed(scene, domain, c + sign * h * d, name) for sign in (-1, 1))
    difference = (more - less)[::2] / (2 * h)
    part = "gradient" if domain.model.form.strain.finite else "strain"
    slopes = values(domain, c, name, part, "volume")
    assert (slopes[1::2] == 0).all()
    strain, volume = changes(domain, c, d)
    predicted = ((slopes[:, :-1] * strain).sum(axis=1) + slopes[:, -1] * volume)[::2]
    assert np.abs(predicted - difference).max() < 1e-6 * np.abs(difference).max()
