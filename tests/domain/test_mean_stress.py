"""The projection of the mean stress on the present grid, and its consequences for runs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI
from runs import Kill, Killed, results_of

import tawami
from tawami.domain import mean_stress

H = 0.125
SOFT = tawami.linear_elastic(E=1e5, nu=0.3)
STIFF = tawami.linear_elastic(E=1e7, nu=0.49)
SOIL = tawami.mohr_coulomb(tawami.linear_elastic(E=1e5, nu=0.3), phi=30.0, c=1e2)


def block(law=SOFT, *, per_axis=3, shift=(0.03, 0.05), **options):
    """A block that does not follow the lines of the grid."""
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=H, cells=(16, 8))
    body = tawami.box(grid, (0.25, 0.25), (0.75, 0.75), per_axis=per_axis)
    body = replace(body, x=body.x + shift, border=None)
    return tawami.Scene(grid, body, law, form="u_epsv_finite", density=1e3, **options)


def strain_of(scene):
    """Mean stress over K of the particles."""
    domain = scene.configuration.domain
    return domain.particles.stress[:, :3].mean(axis=1) / domain.constants["K"]


def give(scene, strain):
    """Give the particles this mean stress over K, with a deviator."""
    domain = scene.configuration.domain
    domain.particles.stress[:] = [3.0, -1.0, -2.0, 5.0]
    domain.particles.stress[:, :3] += (domain.constants["K"] * strain)[:, None]


def test_a_bilinear_field_stays_and_any_other_is_projected():
    scene = block()
    domain = scene.configuration.domain
    x, y = (np.array(scene.particles.x) / H).T
    give(scene, 1e-3 * (1 + x - 2 * y))
    assert mean_stress.project(domain) == pytest.approx(0.0, abs=1e-12)
    assert strain_of(scene) == pytest.approx(1e-3 * (1 + x - 2 * y), rel=1e-9)

    rough = 1e-3 * np.random.default_rng(1).standard_normal(len(x))
    give(scene, rough)
    weight = domain.constants["K"] * domain.particles.volume
    taken = mean_stress.project(domain)
    smooth = strain_of(scene)
    # the energy taken is that of the difference: the projection is orthogonal
    assert taken == pytest.approx(0.5 * weight @ (rough - smooth) ** 2, rel=1e-8)
    assert taken > 0.3 * 0.5 * weight @ rough**2
    assert weight @ smooth == pytest.approx(weight @ rough, rel=1e-8)
    deviator = scene.particles.stress.copy()
    deviator[:, :3] -= deviator[:, :3].mean(axis=1)[:, None]
    assert deviator == pytest.approx(np.tile([3.0, -1.0, -2.0, 5.0], (len(x), 1)), abs=1e-9)
    mean_stress.project(domain)
    assert strain_of(scene) == pytest.approx(smooth, rel=1e-7, abs=1e-12)


def test_one_particle_in_each_cell_keeps_its_stress():
    scene = block(per_axis=1, shift=(0.0, 0.0))
    rough = 1e-3 * np.random.default_rng(1).standard_normal(16)
    give(scene, rough)
    mean_stress.project(scene.configuration.domain)
    assert strain_of(scene) == pytest.approx(rough, rel=1e-7)


def two_materials():
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0, 0), h=H, cells=(16, 8))
    body = tawami.box(grid, (0.25, 0.25), (0.75, 0.75), per_axis=3)
    body = replace(body, x=body.x + np.array([0.03, 0.05]), border=None)
    right = body.x[:, 0] > 0.57  # inside a cell
    return tawami.Scene(
        grid, body, [SOFT, STIFF], material_of=right.astype(np.uint32), form="u_epsv_finite",
        density=1e3,
    )  # fmt: skip


def test_each_material_is_projected_by_itself():
    """A field that jumps with K between the materials of a cell stays as it is."""
    scene = two_materials()
    domain = scene.configuration.domain
    x, y = (np.array(scene.particles.x) / H).T
    stress = 50.0 * (1 + x - y)  # the same in both, so that the strain jumps by a factor of 240
    strain = stress / domain.constants["K"]
    assert len(np.unique(domain.constants["K"])) == 2
    give(scene, strain)
    mean_stress.project(domain)
    assert strain_of(scene) == pytest.approx(strain, rel=1e-7)


def test_statics_where_particles_hardly_move_is_not_projected(monkeypatch):
    monkeypatch.setattr(mean_stress, "project", lambda _: pytest.fail("projected"))
    scene = block(shift=(0.0, -0.25))
    scene.fix("bottom", "x")
    scene.fix("bottom", "y")
    scene.gravity((0.0, -9.81))
    tawami.ramp(scene, 0.25)
    tawami.settle(scene)


def fly(folder, law, each=None):
    """A block flies and spins; what the run computes."""
    scene = block(law)
    motion = tawami.Dynamics(
        scene, velocity=lambda x, y: (3.0 - 8.0 * (y - 0.55), 8.0 * (x - 0.53))
    )
    steps = motion.run(0.06, 0.004, results=results_of(folder), each=each)
    return scene.particles.rows().tobytes(), str(motion.energies), steps


@pytest.mark.parametrize("law", [SOFT, SOIL], ids=["elastic", "Mohr-Coulomb"])
def test_a_run_with_projections_resumes_to_the_bit(tmp_path, monkeypatch, law):
    """Killed between two projections and just after one."""
    calls, project = [], mean_stress.project

    def counted(domain):
        calls.append(0)
        return project(domain)

    monkeypatch.setattr(mean_stress, "project", counted)
    whole = fly(tmp_path / "whole", law)
    assert len(calls) >= 4
    kill = Kill(4, 8, 12)
    for _ in range(3):
        with pytest.raises(Killed):
            fly(tmp_path / "killed", law, kill)
    assert fly(tmp_path / "killed", law, kill) == whole


@pytest.mark.parametrize("law", [SOFT, SOIL], ids=["elastic", "Mohr-Coulomb"])
def test_what_the_projection_takes_is_a_loss_of_the_transfer(monkeypatch, law):
    """The law may have to return a projected stress in the next step; the balance closes."""
    taken, project = [], mean_stress.project

    def recorded(domain):
        taken.append(project(domain))
        return taken[-1]

    monkeypatch.setattr(mean_stress, "project", recorded)
    scene = block(law)
    motion = tawami.Dynamics(
        scene, velocity=lambda x, y: (3.0 - 8.0 * (y - 0.55), 8.0 * (x - 0.53))
    )
    start, rows = motion.kinetic_energy, []
    for _ in range(15):
        motion.step(0.004)
        rows.append((motion.energies, motion.elastic_energy))
    assert len(taken) >= 4
    assert min(taken) > -1e-12 * start
    assert sum(taken) < 0.02 * start
    for energies, elastic in rows:
        assert energies.elastic == pytest.approx(elastic, abs=1e-10 * start)
