"""Small objects of the compiled module, and every call of it with good arguments."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from tawami import _rust

N = 6  # particles


BASIS = "quadratic_spline"


TERMS = [(i, j) for j in range(2) for i in range(2)]


FIELDS = [(BASIS, 2, 2), ("bilinear", 1, 1)]
NODES = [(i, j) for i in range(3) for j in range(3)]


class Sample:
    """Small objects of each kind, new for each example, because calls change them."""

    def __init__(self) -> None:
        self.grid = _rust.Grid((-1.0, 0.5), 0.5, (4, 3))
        random = np.random.default_rng(1)
        self.x = np.array([-1.0, 0.5]) + [2.0, 1.5] * random.random((N, 2))
        self.volume = np.full(N, 0.1)
        self.material = np.zeros(N, dtype=np.uint32)
        self.particles = _rust.Particles(self.x, self.volume, self.material)
        self.particles.carry("velocity", 2)
        self.location = self.grid.locate(self.x)
        self.law = _rust.Material.of("von_mises", (2.0, 1.0), [1e9, 0.0])
        self.particles.add_history([self.law])
        self.active = _rust.Active(self.grid, self.location.active)
        self.stage = _rust.Stage(self.particles, self.location, [self.law], "mixed", False, BASIS)
        self.assembler = _rust.Assembler(
            self.location, FIELDS, NODES, [(0, 0), (0, 1), (1, 0), (1, 1)]
        )
        self.u, self.v, self.all = np.zeros(60), np.zeros(20), np.zeros(80)
        self.selection = (
            np.arange(81, dtype=np.int32), np.arange(80, dtype=np.int32), np.ones(80),
            np.arange(80, dtype=np.int64),
        )  # fmt: skip
        self.pattern = self.assembler.pattern(self.selection)
        self.values = np.zeros(len(self.pattern.columns))
        self.data = np.zeros((N, 4))
        self.rows = np.arange(len(self.location.active), dtype=np.uint32)
        self.packed = np.zeros((len(self.rows), 12))
        self.few = np.array([0, 2], dtype=np.uint32)
        self.given = (np.zeros(4 * N), np.zeros(16 * N), np.zeros(N), np.zeros(N), np.zeros(0))
        self.wanted = [[("sigma", "value", 0, None), ("sigma_m", "value", 3, np.ones(N))]]
        self.requests = _rust.Requests(self.wanted)
        self.none = [_rust.Kernels(self.assembler, rank, []) for rank in (1, 2)]


#: Functions and good arguments.
CALLS: dict[str, Callable[[Sample], tuple[Any, ...]]] = {
    "Grid": lambda s: (_rust.Grid, (0.0, 0.0), 1.0, (2, 3)),
    "Grid.locate": lambda s: (s.grid.locate, s.x),
    "Grid.place": lambda s: (s.grid.place, s.location.cell, s.location.xi),
    "Grid.place_at": lambda s: (s.grid.place_at, s.location.cell.astype(np.int64), s.x),
    "Grid.near": lambda s: (
        s.grid.near, (4, 3), np.ones(12, dtype=bool), np.ones(12, dtype=bool), s.x, s.x, 0.1, 2
    ),
    "carried": lambda s: (
        _rust.carried, s.location, BASIS, s.u, s.x, np.ones((N, 2)), np.zeros(N, dtype=bool)
    ),
    "Grid.window": lambda s: (s.grid.window, (0, 0), (1, 2)),
    "functions_at": lambda s: (_rust.functions_at, s.location, "bilinear"),
    "Location.away_from_sides": lambda s: (s.location.away_from_sides, 1e-5),
    "Location.select": lambda s: (s.location.select, s.few),
    "Active": lambda s: (_rust.Active, s.grid, s.location.active),
    "Active.functions": lambda s: (s.active.functions, BASIS),
    "Active.parts": lambda s: (s.active.parts, BASIS),
    "Active.spread": lambda s: (s.active.spread, BASIS, np.zeros(12, dtype=np.int64)),
    "Active.support": lambda s: (s.active.support, BASIS, 3),
    "Particles": lambda s: (_rust.Particles, s.x, s.volume, s.material),
    "Particles.select": lambda s: (s.particles.select, s.few),
    "Particles.of_rows": lambda s: (s.particles.of_rows, s.particles.rows()),
    "Particles.assign": lambda s: (s.particles.assign, _rust.Particles(s.x, s.volume, s.material)),
    "Particles.carry": lambda s: (s.particles.carry, "acceleration", 2),
    "Particles.carried": lambda s: (s.particles.carried, "velocity"),
    "Particles.history": lambda s: (s.particles.history, "plastic_strain"),
    "Particles.add_strain": lambda s: (s.particles.add_strain, False),
    "Particles.add_history": lambda s: (s.particles.add_history, [s.law]),
    "Particles.move_to": lambda s: (s.particles.move_to, s.x),
    "Particles.check_materials": lambda s: (s.particles.check_materials, [s.law], "mixed", False),
    "Material.linear_elastic_e_nu": lambda s: (_rust.Material.linear_elastic_e_nu, 1.0, 0.3),
    "Material.linear_elastic_e_one_minus_2nu": lambda s: (
        _rust.Material.linear_elastic_e_one_minus_2nu, 1.0, 0.3,
    ),
    "Material.external": lambda s: (_rust.Material.external, "law", (2.0, 1.0), ["a"]),
    "Material.of": lambda s: (_rust.Material.of, "von_mises", (1.0, 0.3), [1.0, 0.0]),
    "Assembler": lambda s: (_rust.Assembler, s.location, FIELDS, NODES, TERMS),
    "Assembler.vector": lambda s: (s.assembler.vector, s.none[0], [s.data], s.volume, s.all),
    "Assembler.pattern": lambda s: (s.assembler.pattern, s.selection),
    "Assembler.matrix": lambda s: (
        s.assembler.matrix, s.none[1], s.none[0], [s.data], s.volume, s.all, s.pattern, s.values,
    ),
    "Kernels": lambda s: (_rust.Kernels, s.assembler, 1, []),
    "Kernels.elasticity": lambda s: (_rust.Kernels.elasticity, s.assembler, "plane_strain"),
    "Kernels.mass": lambda s: (_rust.Kernels.mass, s.assembler),
    "Requests": lambda s: (_rust.Requests, s.wanted),
    "Stage": lambda s: (_rust.Stage, s.particles, s.location, [s.law], "mixed", False, BASIS),
    "Stage.evaluate": lambda s: (
        s.stage.evaluate, s.u, s.v, s.requests, [s.data], s.given,
    ),
    "Stage.commit": lambda s: (s.stage.commit, s.u, s.v, s.given),
    "Stage.strains": lambda s: (s.stage.strains, s.u, s.v),
    "Stage.volume_strains": lambda s: (s.stage.volume_strains, s.u, s.v),
    "interpolate": lambda s: (_rust.interpolate, s.location, BASIS, 2, s.u),
    "gradients": lambda s: (_rust.gradients, s.location, BASIS, s.u),
    "basis_1d": lambda s: (
        _rust.basis_1d, BASIS, 4, np.array([0, 3], dtype=np.int64), np.array([0.5, 1.0]),
    ),
    "basis_len": lambda s: (_rust.basis_len, BASIS, 4),
    "gauss": lambda s: (_rust.gauss, 3),
    "logarithmic_strain": lambda s: (_rust.logarithmic_strain, np.zeros((3, 4))),
    "densities": lambda s: (
        _rust.densities, s.location, s.volume, s.data, TERMS, False, s.rows, [0, 1], 2, s.packed,
    ),
    "nodal_sums": lambda s: (_rust.nodal_sums, s.location, s.volume, s.data, BASIS),
    "cell_sums": lambda s: (_rust.cell_sums, s.location, s.volume, s.data),
    "extraction": lambda s: (
        _rust.extraction, BASIS, (4, 3), np.array([0, 11]), np.array([[0.0, 0.5], [1.0, 0.3]]),
    ),
}  # fmt: skip
