"""The differential operators of a geometry, in UFL.

In plane strain and in three dimensions these are UFL's own. In axisymmetry r = x[0] is the radius and
z = x[1] the axis, and the hoop direction t is third.
Vectors have the two components of a field, or three:

    grad f = (f,r, f,z, 0)
    grad v = [[v_r,r, v_r,z, -v_t/r], [v_z,r, v_z,z, 0], [v_t,r, v_t,z, v_r/r]]
    div v  = v_r,r + v_z,z + v_r/r
    div s  = (s_rr,r + s_rz,z + (s_rr - s_tt)/r,
              s_zr,r + s_zz,z + s_zr/r,
              s_tr,r + s_tz,z + (s_tr + s_rt)/r).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations, product
from typing import Any, NoReturn

import ufl
from ufl.classes import Curl, Div, Grad, NablaDiv, NablaGrad
from ufl.corealg.traversal import unique_pre_traversal
from ufl.domain import extract_domains

from tawami.base.errors import FormError
from tawami.base.space import Space

#: What a form must do to work in axisymmetry.
ADVICE = (
    "take grad, div, eps and I as arguments of the residual, not from UFL: in axisymmetry tensors "
    "have a third row, for the hoop direction"
)


@dataclass(frozen=True)
class Operators:
    """Operators of a residual in a space.

    Args:
        space: Dimension and geometry.
        domain: The UFL mesh of the fields.
    """

    space: Space
    domain: Any

    @property
    def names(self) -> dict[str, Any]:
        """The operators by the names under which a residual asks for them."""
        return {"grad": self.grad, "div": self.div, "eps": self.eps, "I": self.I, "dim": self.dim}

    @property
    def dim(self) -> int:
        """Rows of a tensor."""
        return self.space.dim + self.space.hoop

    @property
    def I(self) -> Any:  # noqa: E743 - the letter of the paper
        """Unit tensor."""
        return ufl.Identity(self.dim)

    @property
    def volume(self) -> Any:
        """Factor of an integral over the mesh: the length of the circle, or 1."""
        return 2 * ufl.pi * self._radius if self.space.hoop else ufl.as_ufl(1.0)

    def grad(self, f: Any) -> Any:
        """Gradient of a scalar (a vector) or of a vector (a tensor).

        Raises:
            FormError: In axisymmetry, f is neither.
        """
        f = ufl.as_ufl(f)
        if not self.space.hoop:
            return ufl.grad(f)
        if f.ufl_shape == ():
            return ufl.as_vector([*self._slopes(f), 0])
        v = self._vector(f, "grad")
        rows = [self._slopes(component) for component in v]
        around = (-v[2] / self._radius, ufl.as_ufl(0.0), v[0] / self._radius)
        return ufl.as_matrix([[*row, t] for row, t in zip(rows, around, strict=True)])

    def div(self, f: Any) -> Any:
        """Divergence of a vector (a scalar) or of a tensor (a vector).

        Raises:
            FormError: f is neither.
        """
        f = ufl.as_ufl(f)
        if f.ufl_shape == ():
            raise FormError("div of a scalar: expected a vector or a tensor")
        if not self.space.hoop:
            return ufl.div(f)
        r = self._radius
        if len(f.ufl_shape) == 1:
            v = self._vector(f, "div")
            return self._slopes(v[0])[0] + self._slopes(v[1])[1] + v[0] / r
        if f.ufl_shape != (self.dim,) * 2:
            self._unexpected("div", f, f"a vector, or a tensor of shape {(self.dim,) * 2}")
        around = (f[0, 0] - f[2, 2], f[1, 0], f[2, 0] + f[0, 2])
        return ufl.as_vector(
            [
                self._slopes(f[i, 0])[0] + self._slopes(f[i, 1])[1] + t / r
                for i, t in enumerate(around)
            ]
        )

    def eps(self, u: Any) -> Any:
        """Strain of a displacement: the symmetric part of its gradient.

        Raises:
            FormError: u is no vector.
        """
        u = ufl.as_ufl(u)
        if len(u.ufl_shape) != 1:
            self._unexpected("eps", u, "a vector")
        return ufl.sym(self.grad(u))

    def gradient(self, u: Any) -> tuple[Any, ...]:
        """Components of grad u, as `Space.gradient`: xx, xy, yx, yy, and in axisymmetry zz."""
        g, axes = self.grad(u), range(self.space.dim)
        return (*(g[i, j] for i, j in product(axes, repeat=2)), *self._hoop(g))

    def strain(self, u: Any) -> tuple[Any, ...]:
        """Strains of a displacement: xx, yy, gamma_xy, and in axisymmetry zz."""
        e, axes = self.eps(u), range(self.space.dim)
        shears = (2 * e[i, j] for i, j in combinations(axes, 2))
        return (*(e[i, i] for i in axes), *shears, *self._hoop(e))

    def tensor(self, components: Sequence[Any]) -> Any:
        """The tensor of these components, in the order of :meth:`strain` (symmetric, the components of a
        stress) or of :meth:`gradient`.

        Raises:
            FormError: Another number of components.
        """
        n, dim = len(components), self.space.dim
        if n not in (self.space.num_strains, len(self.space.gradient)):
            raise FormError(
                f"a tensor of {n} components: expected {self.space.num_strains} of a stress, or "
                f"{len(self.space.gradient)} of a gradient"
            )
        if n == self.space.num_strains:
            pairs = [*((i, i) for i in range(dim)), *combinations(range(dim), 2)]
        else:
            pairs = [(i, j) for i in range(dim) for j in range(dim)]
        pairs += [(dim, dim)] * self.space.hoop
        places = dict(zip(pairs, components, strict=True))
        if n == self.space.num_strains:
            places |= {(j, i): places[i, j] for i, j in pairs}
        rows = range(self.dim)
        return ufl.as_matrix([[places.get((i, j), ufl.as_ufl(0.0)) for j in rows] for i in rows])

    def along(self, f: Any, n: Any) -> Any:
        """A n of a tensor, with the components of a field, or g . n of a vector.

        Args:
            f: The tensor A or the vector g.
            n: A vector in the plane.

        Raises:
            FormError: f is neither.
        """
        f, axes = ufl.as_ufl(f), range(self.space.dim)
        if len(f.ufl_shape) not in (1, 2) or {*f.ufl_shape} - {self.space.dim, self.dim}:
            self._unexpected("dot_n", f, "a vector or a tensor")
        if len(f.ufl_shape) == 1:
            return sum(f[j] * n[j] for j in axes)
        return ufl.as_vector([sum(f[i, j] * n[j] for j in axes) for i in axes])

    def volume_change(self, u: Any, du: Any, *, finite: bool) -> Any:
        """Change of div u, or of ln det (I + grad u), with du."""
        if finite:
            return ufl.inner(ufl.inv(self.I + self.grad(u)).T, self.grad(du))
        return self.div(du)

    def check(self, expression: Any) -> None:
        """Check that an expression has no derivative of UFL that lacks the hoop direction.

        Raises:
            FormError: In axisymmetry, the gradient or divergence of a vector by UFL.
        """
        if not self.space.hoop:
            return
        for node in unique_pre_traversal(expression):
            of_vector = isinstance(node, Grad) and node.ufl_operands[0].ufl_shape
            if of_vector or isinstance(node, (Curl, Div, NablaDiv, NablaGrad)):
                raise FormError(f"a derivative of a vector by UFL, {node}: {ADVICE}")

    @property
    def _radius(self) -> Any:
        return ufl.SpatialCoordinate(self.domain)[0]

    def _slopes(self, f: Any) -> list[Any]:
        """Derivatives of a scalar along the axes."""
        if not extract_domains(f):  # a number
            return [ufl.as_ufl(0.0)] * self.space.dim
        return [f.dx(axis) for axis in range(self.space.dim)]

    def _hoop(self, tensor: Any) -> tuple[Any, ...]:
        return (tensor[self.space.dim, self.space.dim],) if self.space.hoop else ()

    def _vector(self, v: Any, caller: str) -> list[Any]:
        """Components of a vector along r, z and around."""
        if v.ufl_shape not in ((self.space.dim,), (self.dim,)):
            self._unexpected(caller, v, "a scalar or a vector" if caller == "grad" else "a vector")
        return [v[0], v[1], v[2] if v.ufl_shape == (self.dim,) else ufl.as_ufl(0.0)]

    def _unexpected(self, caller: str, f: Any, expected: str) -> NoReturn:
        raise FormError(f"{caller} of an expression of shape {f.ufl_shape}: expected {expected}")
