"""Warnings of forms that lock: nearly incompressible materials without a field for the volume."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tawami import _rust
from tawami.base import ranks
from tawami.base.errors import LockingWarning
from tawami.base.warn import warn
from tawami.form.form import Form
from tawami.grid.grid import Grid

#: K/mu from which displacement-only forms lock: nu = 0.49. At 0.495 the mean stress of the cantilever
#: has 4 times the error that it has at 0.3, at 0.49995 70 times (`python -m cases.extremes`).
LOCKS = 50.0


def warn_of_first(
    grid: Grid, form: Form, materials: Sequence[_rust.Material], particles: _rust.Particles
) -> None:
    """Warn of the first of the particles that lock most; a call for all ranks."""
    ratios = np.array([m.bulk_modulus / m.shear_modulus for m in materials])[particles.material]
    most = ranks.largest(grid.comm, float(ratios.max(initial=0.0)))
    number = particles.number[ratios == most].min(initial=np.iinfo(np.uint32).max)
    warn_of(grid, form, most, int(ranks.least_of(grid.comm, np.array([number]))[0]))


def warn_of(grid: Grid, form: Form, ratio: float, number: int) -> None:
    """Warn of a nearly incompressible material in a form without a field for the volume.

    Args:
        grid: The grid.
        form: The form.
        ratio: Largest K/mu of a particle.
        number: Of this particle.
    """
    if not form.kinematics.locks or grid.comm.rank or ratio < LOCKS:
        return
    warn(
        f"form {form.name} has no field for the volume, and K/mu = {ratio:.3g} at particle {number}: it "
        f"locks, and its mean stress is useless where K/mu is large. Expected K/mu below {LOCKS:g} "
        "(nu < 0.49); use form 'u_epsv' or 'u_epsv_finite'",
        LockingWarning,
    )
