"""Point kernels: the integrand of a form at one point, as a function of a few numbers.

Values and derivatives of the fields at the point become the components of one vector coefficient, those
of the test functions and of the changes of the fields the components of the arguments. FFCx compiles the
result without basis functions and without a loop over points; Rust multiplies it by the functions at the
particles (`rust/assembly/point.rs`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import ufl
from ufl.algorithms.expand_indices import expand_indices
from ufl.algorithms.remove_complex_nodes import remove_complex_nodes
from ufl.classes import Argument, Constant, Grad, Indexed, SpatialCoordinate, Variable
from ufl.corealg.traversal import unique_pre_traversal

from tawami.base.errors import FormError
from tawami.fem import dolfinx
from tawami.form.quantities import Density, ParticleScalar
from tawami.form.symbols import Symbols

#: Component of the fields and axes of its derivatives: (0, ()) is u_x, (1, (0,)) is du_y/dx.
Entry = tuple[int, tuple[int, ...]]


@dataclass(frozen=True)
class PointForm:
    """An integrand at a point.

    Attributes:
        form: The form on a unit interval with one point.
        fields, test, trial: Meaning of the components of the coefficient of the fields, of the test
            function and of the trial function; empty for the last in a linear form.
    """

    form: Any
    fields: tuple[Entry, ...]
    test: tuple[Entry, ...]
    trial: tuple[Entry, ...]


class Integrand:
    """The integrand of a form as a function of numbers at a point.

    Args:
        form: Integrals over cells with one quadrature rule and with expanded derivatives.
        symbols: Symbols of the form.

    Attributes:
        data: Particle data that it reads.
        reads_position: Whether it reads the position x of the point.

    Raises:
        FormError: It contains derivatives that the functions or the particles do not have.
    """

    def __init__(self, form: Any, symbols: Symbols) -> None:
        first, *more = (part.integrand() for part in form.integrals())
        lowered = _without_variables(remove_complex_nodes(sum(more, first)))
        self._integrand = expand_indices(lowered)
        self._of_fields: dict[Any, tuple[Any, Entry]] = {}
        self._of_data: dict[Any, tuple[Density, int]] = {}
        self._of_position: dict[Any, int] = {}
        self._constants: list[Any] = []
        for node in unique_pre_traversal(self._integrand):
            if isinstance(node, Constant):
                self._constants.append(node)
            elif isinstance(node, Indexed):
                self._read(node, symbols)
        self.data = list(dict.fromkeys(density for density, _ in self._of_data.values()))
        self.reads_position = bool(self._of_position)

    def _read(self, node: Any, symbols: Symbols) -> None:
        """Find what a component of a symbol or of its derivatives stands for."""
        symbol, index = node.ufl_operands
        while isinstance(symbol, Grad):
            (symbol,) = symbol.ufl_operands
        if isinstance(symbol, Constant):
            return
        if isinstance(symbol, SpatialCoordinate):
            self._of_position[node] = int(index[0])
            return
        component, *derivatives = map(int, index)
        axes = tuple(sorted(derivatives))
        if symbol == symbols.increments or isinstance(symbol, Argument):
            if len(axes) > 2:
                raise FormError(
                    "a third derivative in a sum: expected at most second derivatives of fields"
                )
            kind = symbol.number() if isinstance(symbol, Argument) else "fields"
            self._of_fields[node] = kind, (component, axes)
        elif (density := symbols.data.of(symbol)) is not None:
            if axes:
                raise FormError(
                    f"a derivative of particle data ({_text(density)}): expected derivatives of fields "
                    "and of old fields"
                )
            self._of_data[node] = density, component
        elif (density := symbols.data_of(symbol, component, axes)) is not None:
            self._of_data[node] = density, 0

    def form(self, columns: Mapping[Density, tuple[Any, int]], position: Any) -> PointForm:
        """The form on a unit interval.

        Args:
            position: The vector coefficient of the position of the point.
            columns: Of the data, the vector coefficient on the interval (see :func:`vector`) and its
                first component there.
        """
        domain, kinds = dolfinx.interval(), ("fields", 0, 1)
        used = set(self._of_fields.values())
        entries = {kind: tuple(sorted(e for k, e in used if k == kind)) for kind in kinds}
        vectors: dict[Any, Any] = {
            n: ufl.Argument(_space(len(entries[n]), domain), n) for n in (0, 1) if entries[n]
        }
        vectors["fields"] = vector(len(entries["fields"]), 0, domain)
        replaced: dict[Any, Any] = {
            node: ufl.Constant(domain, node.ufl_shape, count=node.count())
            for node in self._constants
        }
        for node, axis in self._of_position.items():
            replaced[node] = position[axis]
        for node, (density, component) in self._of_data.items():
            to, first = columns[density]
            replaced[node] = to[first + component]
        for node, (kind, entry) in self._of_fields.items():
            replaced[node] = vectors[kind][entries[kind].index(entry)]
        measure = ufl.dx(domain=domain, metadata={"quadrature_degree": 0})
        integrand = ufl.replace(self._integrand, replaced)
        return PointForm(integrand * measure, *(entries[k] for k in kinds))


def _text(density: Density) -> str:
    quantity = density.quantity
    return quantity.text if isinstance(quantity, ParticleScalar) else quantity.name


def _without_variables(expression: Any) -> Any:
    """Replace variables by their expressions: UFL expands the indices of tensor variables wrongly."""
    while True:
        nodes = unique_pre_traversal(expression)
        variables = {node: node.ufl_operands[0] for node in nodes if isinstance(node, Variable)}
        if not variables:
            return expression
        expression = ufl.replace(expression, variables)


def vector(size: int, count: int, domain: Any = None) -> Any:
    """A coefficient with `size` components, at least one, on the unit interval."""
    return ufl.Coefficient(_space(size, domain or dolfinx.interval()), count=count)


def _space(size: int, domain: Any) -> Any:
    return ufl.FunctionSpace(domain, dolfinx.on_interval(max(size, 1)))
