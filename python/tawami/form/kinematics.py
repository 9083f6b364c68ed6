"""The kinematics and the strain measure of a form, and everything that differs between them.

The kinematics follow from the roles of the fields; a form file declares `strain = "finite"`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import scipy.linalg as la

from tawami.base.arrays import Array
from tawami.form.fields import Field
from tawami.form.quantities import Part


@dataclass(frozen=True)
class Kinematics:
    """Strain that the material law receives at a particle.

    Attributes:
        name: As a form file declares it.
        role: Role of the field that determines the mean stress, if there is one.
        has_eps_v: Whether the elastic volumetric strain is a field. Particles store the total.
        volume_at_centre: Whether it is that of the displacement at the centre of the cell.
        deviatoric: Whether the law receives the deviator alone: the pressure is a field.
        locks: Whether the displacement alone is evaluated at the particles: locks near nu = 0.5.
    """

    name: str
    role: str | None = None
    has_eps_v: bool = False
    volume_at_centre: bool = False
    deviatoric: bool = False
    locks: bool = False

    @property
    def has_mean_stress(self) -> bool:
        """Whether the volumetric field determines the mean stress that the law receives."""
        return self.role is not None

    def __str__(self) -> str:
        return self.name


@dataclass(frozen=True)
class StrainMeasure:
    """Strains of a displacement gradient, and the stresses that belong to them.

    Attributes:
        name: As a form file declares it.
        finite: Whether strains are finite. Then each step moves the particles and resets the grid.
        quantities: Names of the quantities that the material law gives.
        stress: Name of the stress.
        stress_xx_yy_xy: Places of xx, yy and xy among its components.
        deviator: Name of its deviator.
        mean: Name of the mean stress.
        gradient_part: Derivative that the tangent of a quantity contains: by strain or by gradient.
        mixed_form: The shipped form with a field for the volumetric strain.
        description: Text for the header of a run.
    """

    name: str
    finite: bool
    quantities: tuple[str, ...]
    stress: str
    stress_xx_yy_xy: tuple[int, int, int]
    deviator: str
    mean: str
    gradient_part: Part
    mixed_form: str
    description: str

    def __str__(self) -> str:
        return self.name

    def metric_change(self, gradient: Array) -> Array:
        """Twice the strain that vanishes for rigid motions; `gradient` is n x rows x rows."""
        transposed = gradient.transpose(0, 2, 1)
        change = gradient + transposed
        return change + transposed @ gradient if self.finite else change

    def rotation(self, angle: float) -> Array:
        """Displacement gradient of a rotation in the plane (2 x 2); of an infinitesimal one at small
        strain, divided by the angle.
        """
        c, s = np.cos(angle), np.sin(angle)
        return np.array([[c - 1, -s], [s, c - 1]] if self.finite else [[0.0, -1.0], [1.0, 0.0]])

    def of_gradient(self, gradient: Array) -> Array:
        """Strain tensor of a displacement gradient (dim x dim each), logarithmic at finite strain."""
        if self.finite:
            f = np.eye(len(gradient)) + gradient
            return np.asarray(np.real(la.logm(f @ f.T)) / 2)
        return np.asarray((gradient + gradient.T) / 2)


KINEMATICS: Mapping[str, Kinematics] = {
    kinematics.name: kinematics
    for kinematics in (
        Kinematics("displacement", locks=True),
        Kinematics("cell", volume_at_centre=True),
        Kinematics("mixed", "volumetric_strain", has_eps_v=True),
        Kinematics("deviatoric", "pressure", deviatoric=True),
    )
}


def kinematics_of(fields: Mapping[str, Field]) -> str:
    """Name of the kinematics that follow from the roles of the fields."""
    roles = {field.role for field in fields.values()} - {None}
    return next((k.name for k in KINEMATICS.values() if k.role in roles), "displacement")


STRAIN_MEASURES: Mapping[str, StrainMeasure] = {
    "small": StrainMeasure(
        name="small",
        finite=False,
        quantities=("sigma", "s", "sigma_m", "eps_p"),
        stress="sigma",
        stress_xx_yy_xy=(0, 1, 2),
        deviator="s",
        mean="sigma_m",
        gradient_part="strain",
        mixed_form="u_epsv",
        description="small strain",
    ),
    "finite": StrainMeasure(
        name="finite",
        finite=True,
        quantities=("P", "P_s", "tau_m", "ln_J", "eps_p"),
        stress="P",
        stress_xx_yy_xy=(0, 3, 1),
        deviator="P_s",
        mean="tau_m",
        gradient_part="gradient",
        mixed_form="u_epsv_finite",
        description="finite strain, particles that move",
    ),
}
