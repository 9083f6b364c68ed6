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
from ufl.classes import Argument, Constant, Grad, Indexed, Variable
from ufl.corealg.traversal import unique_pre_traversal

from tawami.base.errors import FormError
from tawami.fem import dolfinx

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


def at_point(form: Any, increments: Any, data: Mapping[Any, tuple[Any, int]]) -> PointForm:
    """The integrand of a form as a function of the fields at a point.

    Args:
        form: Integrals over cells with one quadrature rule and with expanded derivatives.
        increments: Coefficient of the fields.
        data: Of each other coefficient, the vector coefficient on the interval that replaces it (see
            :func:`vector`), and its first component there.
    """
    integrand, *more = (part.integrand() for part in form.integrals())
    integrand = expand_indices(_without_variables(remove_complex_nodes(sum(more, integrand))))
    domain, kinds = dolfinx.interval(), ("fields", 0, 1)
    replaced: dict[Any, Any] = {}
    of_fields: dict[Any, tuple[Any, Entry]] = {}
    for node in unique_pre_traversal(integrand):
        if isinstance(node, Constant):
            replaced[node] = ufl.Constant(domain, count=node.count())
        elif isinstance(node, Indexed):
            symbol, index = node.ufl_operands
            if symbol in data:
                to, first = data[symbol]
                replaced[node] = to[first + int(index[0])]
            elif (found := _entry(node, increments)) is not None:
                of_fields[node] = found
    used = set(of_fields.values())
    entries = {kind: tuple(sorted(e for k, e in used if k == kind)) for kind in kinds}
    vectors: dict[Any, Any] = {
        n: ufl.Argument(_space(len(entries[n]), domain), n) for n in (0, 1) if entries[n]
    }
    vectors["fields"] = vector(len(entries["fields"]), 0, domain)
    for node, (kind, entry) in of_fields.items():
        replaced[node] = vectors[kind][entries[kind].index(entry)]
    measure = ufl.dx(domain=domain, metadata={"quadrature_degree": 0})
    return PointForm(ufl.replace(integrand, replaced) * measure, *(entries[k] for k in kinds))


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


def _entry(node: Any, increments: Any) -> tuple[Any, Entry] | None:
    """Kind ('fields', or the number of an argument) and entry of a component; None for anything else."""
    symbol, index = node.ufl_operands
    while isinstance(symbol, Grad):
        (symbol,) = symbol.ufl_operands
    if symbol != increments and not isinstance(symbol, Argument):
        return None
    component, *axes = map(int, index)
    if len(axes) > 2:
        raise FormError(
            "a third derivative in a sum: expected at most second derivatives of fields"
        )
    kind = symbol.number() if isinstance(symbol, Argument) else "fields"
    return kind, (component, tuple(sorted(axes)))
