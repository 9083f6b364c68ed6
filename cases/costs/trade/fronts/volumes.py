"""Volumes in the integrals: those of the particles, corrected ones, and Gauss points."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
from mpi4py import MPI

import tawami
from cases.costs.trade.fronts.measure import Row, compared
from cases.showcase.collapse import pile
from cases.verification import ring
from cases.verification.cantilever import mpm
from cases.verification.cantilever.beam import V_THEORY
from cases.verification.cook import membrane

NU = 0.4999


def beam(n: float, **options: Any) -> float:
    """Error of the deflection of the cantilever with the support `exact`."""
    return mpm.solve("u_epsv", "exact", round(n), **options)[0].deflection_m / V_THEORY - 1


def cook(n: float, per_axis: int = 3, gauss: bool = False, **options: Any) -> float:
    """Error of the deflection of Cook's membrane with n cells along the loaded side."""
    h = 16 / n
    cells = (round(membrane.LENGTH / h), round(membrane.HEIGHT / h))
    grid = tawami.Grid(MPI.COMM_WORLD, origin=(0.0, 0.0), h=h, cells=cells)
    body = tawami.polygon(grid, membrane.CORNERS, per_axis=per_axis, gauss=gauss)
    scene = tawami.Scene(grid, body, tawami.linear_elastic(E=membrane.E, nu=NU), **options)
    scene.fix("left", "x")
    scene.fix("left", "y")
    scene.traction("right", (0.0, membrane.SHEAR))
    return scene.solve().displacement(membrane.MIDDLE)[1] / membrane.REFERENCE[NU] - 1


def small_ring(n: float, **options: Any) -> float:
    """Error of the mean stress of the ring, rms."""
    return ring.small(round(n), **options).rms / 100


def large_ring(n: float, **options: Any) -> float:
    """Error of the mean stress of the ring at large strain, rms."""
    return ring.large(round(n), steps=5, **options).rms / 100


@functools.cache
def finest() -> float:
    """Run-out of a pile with 40 cells over its length [m]."""
    return run_out(40, "own")


def run_out(n: float, volumes: str) -> float:
    """Run-out of a pile with n cells over its length, at 0.3 s [m]."""
    motion = pile.build("u_epsv_finite", h=pile.LENGTH / n, per_axis=3, volumes=volumes)
    motion.run(0.3, 2e-3)
    return float(np.quantile(motion.scene.particles.x[:, 0], 0.99))


def collapse(n: float, volumes: str) -> float:
    """Error of the run-out of the pile, against that of the finest pile."""
    return run_out(n, volumes) / finest() - 1


#: Ways, of which the first is the one that the others are compared with.
PLANE: dict[str, dict[str, Any]] = {
    "own": {"volumes": "own"},
    "full cells": {},
    "fitted": {"volumes": "fitted"},
    "Gauss points": {"gauss": True},
}
MOVING = {way: PLANE[way] for way in ("own", "fitted")}


def with_particles(per_axis: int) -> dict[str, dict[str, Any]]:
    """The ways with evenly spaced particles or Gauss points."""
    name = f"{per_axis} x {per_axis}"
    return {f"{name}, {way}": options | {"per_axis": per_axis} for way, options in PLANE.items()}


def rows() -> list[Row]:
    """All comparisons."""
    found = []
    for per_axis in (2, 3):
        ways = with_particles(per_axis)
        found += compared("cantilever", ways, (8, 16, 32, 64), beam)
        found += compared("Cook", ways, (8, 16, 32), cook)
    found += compared("ring", PLANE, (4, 8, 16), small_ring)
    found += compared("ring, large strain", MOVING, (4, 8), large_ring, repeats=1)
    finest()
    return found + compared("collapse", MOVING, (10, 20), collapse, repeats=1)
