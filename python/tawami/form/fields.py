"""The fields of a form, as `fields = {"u": vector("w"), "p": scalar("q", role="pressure")}`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from tawami.base.checks import LEAST, number, one_of, shown
from tawami.base.errors import FormError, InputError
from tawami.base.space import PLANE
from tawami.base.text import quoted
from tawami.fem import dolfinx

#: What the law receives of a field with this role, and the unit of the field.
ROLES: Mapping[str, str] = {"displacement": "m", "volumetric_strain": "-", "pressure": "Pa"}
#: Bases of a scalar field: linear along each axis, or quadratic splines.
BASES = ("bilinear", "quadratic_spline")


@dataclass(frozen=True, repr=False)
class Field:
    """One unknown of a form; made by :func:`vector` or :func:`scalar`.

    Attributes:
        test: Name of its test function.
        components: Number of components.
        role: 'displacement', 'volumetric_strain' or 'pressure': what the law receives. A field without a
            role is the user's own, and particles store its value and gradient.
        basis: 'bilinear' or 'quadratic_spline'; None for the basis of the scene.
        unit: In text.
        scale: A value that counts as large [unit], by which the linear solver divides the field; None
            for the diagonal of the tangent.
    """

    test: str
    components: int
    role: str | None
    basis: str | None
    unit: str
    scale: float | None = None

    @property
    def degree(self) -> int:
        """Degree along each axis of its Lagrange element on the mesh."""
        return 1 if self.basis == "bilinear" else 2

    @property
    def num_dofs(self) -> int:
        """Number of degrees of freedom of that element."""
        return self.components * len(dolfinx.reference_nodes(self.degree))

    def __repr__(self) -> str:
        """As a form declares it."""
        if self.role == "displacement":
            return f"vector({self.test!r})"
        given = {"role": self.role, "basis": self.basis, "unit": self.unit, "scale": self.scale}
        usual = {"role": None, "basis": "bilinear", "unit": ROLES.get(self.role or "", "-")}
        said = [f"{name}={value!r}" for name, value in given.items() if value != usual.get(name)]
        return f"scalar({', '.join([repr(self.test), *said])})"

    @property
    def own(self) -> bool:
        """Whether it is a field of the user's, which no law receives."""
        return self.role is None


def element_of(fields: Mapping[str, Field]) -> Any:
    """Element of all fields on the mesh."""
    return dolfinx.element_of([(field.degree, field.components) for field in fields.values()])


def vector(test: str) -> Field:
    """The displacement increment [m], in the basis of the scene.

    Args:
        test: Name of its test function.
    """
    return Field(_name(test), PLANE.dim, "displacement", None, ROLES["displacement"])


def scalar(
    test: str,
    *,
    role: str | None = None,
    basis: str = "bilinear",
    unit: str | None = None,
    scale: float | None = None,
) -> Field:
    """A scalar field.

    Args:
        test: Name of its test function.
        role: 'volumetric_strain' or 'pressure' [Pa], of which a form has at most one; none for any other
            field, as a pore pressure or a temperature.
        basis: 'bilinear' or 'quadratic_spline'.
        unit: Unit, for outputs and messages; '-' by default.
        scale: A value that counts as large [unit], by which the linear solver divides the field. By
            default it divides by the square root of the diagonal of the tangent.

    Raises:
        FormError: An unknown role or basis, a unit, basis or scale that contradicts the role, or a scale
            that is no positive number.
    """
    roles = [name for name in ROLES if name != "displacement"]
    if role is not None and not one_of(role, roles):
        raise FormError(
            f"scalar({shown(test)}, role={shown(role)}): expected {quoted(roles)}, or no role for a "
            "field that no law receives"
        )
    if not one_of(basis, BASES):
        raise FormError(
            f"scalar({shown(test)}, basis={shown(basis)}): expected one of {quoted(BASES)}"
        )
    if role is not None and (basis != "bilinear" or scale is not None):
        what = f"scale={shown(scale)}" if basis == "bilinear" else f"basis='{basis}'"
        raise FormError(
            f"scalar({shown(test)}, role='{role}', {what}): the law and the solver expect a bilinear "
            "field with the scale of the material: leave it out"
        )
    fixed = ROLES.get(role or "")
    if unit is not None and (not isinstance(unit, str) or fixed not in (None, unit)):
        expected = "text, as 'Pa'" if fixed is None else f"'{fixed}', or no unit"
        raise FormError(f"scalar({shown(test)}, unit={shown(unit)}): expected {expected}")
    if scale is not None:
        try:
            scale = number("scale", scale, low=LEAST)
        except InputError as error:
            raise FormError(f"scalar({shown(test)}, scale=...): {error}") from None
    return Field(_name(test), 1, role, basis, fixed or unit or "-", scale)


def _name(test: str) -> str:
    if not isinstance(test, str) or not test.isidentifier():
        raise FormError(
            f"test function {shown(test)}: expected a name, as vector('w') or scalar('q')"
        )
    return test
