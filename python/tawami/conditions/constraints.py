"""Constraints of the supports of a scene in one step."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from tawami.base.arrays import Array, Mask
from tawami.base.errors import SupportError, SupportWarning
from tawami.base.warn import warn
from tawami.conditions import step_values
from tawami.conditions.action import Term
from tawami.conditions.agreement import others_hold
from tawami.conditions.held_border import HeldBorder
from tawami.conditions.support import Support
from tawami.conditions.supports import Supports
from tawami.conditions.wall_states import ActiveSet
from tawami.conditions.walls import on_functions
from tawami.domain.domain import Domain
from tawami.domain.moving_points import MovingPoints
from tawami.field.constraints import Held, PointHeld
from tawami.field.reduction import Reduction


def constraints(
    supports: Supports,
    domain: Domain,
    amount: Callable[[Term], float],
    start: Array,
    before: Array,
    *,
    moving: bool,
    fields: step_values.Fields | None = None,
    also: Sequence[PointHeld] = (),
) -> tuple[Reduction, ActiveSet, list[HeldBorder]]:
    """Unknowns that the supports leave free, the walls in their present states, and the supports on
    patches of the border.

    Args:
        supports: The supports of a scene.
        domain: The particles where they are.
        amount: Factor of each value of a support.
        start: Coefficients at the start of the step, which the amounts include.
        before: Displacement coefficients since the start of the scene where particles do not move,
            0 where they do. Walls measure distances from it.
        moving: Inertia or stress holds the body: rigid motions may be free.
        fields: Fields without a role and what is prescribed for them; they stay by default.
        also: Constraints by contact that prevent rigid motions.

    Raises:
        SupportError: The body has left a point, or supports contradict each other.
    """
    layout, held, points = domain.layout, list[Held](), list[PointHeld]()
    border = list[HeldBorder]()
    for support in [*supports.all, *supports.axis]:
        if isinstance(support.place, tuple):
            points.append(step_values.at_point(domain, support, amount))
            continue
        for edge in support.edges:
            cells = step_values.touched(domain, supports.border, support, edge)
            if not len(cells):
                _check_left(support, support in supports.axis, moving=moving)
                continue
            if support.is_field:
                of = step_values.of_field(domain, support, edge, cells, start, fields)
            else:
                of = step_values.on_edge(domain, support, edge, cells, amount)
            held.append(of)
        if isinstance(support.place, MovingPoints) and support.weak.any():
            given = fields.amount if support.is_field and fields else amount
            mine = support.weak & ~others_hold(support, border, given)
            if mine.any():
                border.append(_on_patches(domain, support, amount, start, fields, mine))
    fixed, prescribed = [one.indices for one in held], []
    walls = on_functions(supports.walls, domain)
    for wall, of_border in walls.items():
        by_others = [other.stopped for other in walls if other is not wall]
        prescribed.append(wall.prescribed([*fixed, *by_others]) | of_border[:, None])
        held += wall.held(layout, prescribed[-1], start, before)
    contact = ActiveSet(layout, [*walls], prescribed)
    rows = [row for one in border for row in one.rows] if not moving else []
    rows += also
    may_move = moving or domain.model.compiled.may_hold
    reduction = Reduction(layout, held, points, start, moving=may_move, also=rows)
    return reduction, contact, border


def _check_left(support: Support, on_axis: bool, *, moving: bool) -> None:
    """Report that loose particles have left the edge of the grid on which they were held.

    Raises:
        SupportError: In statics, or if the support moves.
    """
    if on_axis or support.told:
        return
    told = (
        f"{support} {support.axis}: the particles have left that edge of the grid, so that it holds "
        "nothing: expected support.release(), or a body with a border, which is held where it is"
    )
    if not moving or support.moves:
        raise SupportError(told)
    support.told = True
    warn(told, SupportWarning)


def _on_patches(
    domain: Domain,
    support: Support,
    amount: Callable[[Term], float],
    start: Array,
    fields: step_values.Fields | None,
    chosen: Mask,
) -> HeldBorder:
    """A support on points of the border, held by tractions on patches."""
    if not support.is_field:
        return HeldBorder(domain, support, step_values.at_points(support, amount), start, chosen)
    assert isinstance(support.place, MovingPoints)
    place, cells = domain.layout.fields[str(support.component)], support.place.cells(domain)

    def at_points(coefficients: Array) -> Array:
        return cells.at(place.basis, coefficients[place.slice, None])[:, 0]

    now = at_points(start)
    if fields is None:
        return HeldBorder(domain, support, now, start, chosen)
    missing = step_values.at_points(support, fields.amount) - at_points(fields.old)
    return HeldBorder(domain, support, now + fields.share * missing, start, chosen)


def num_free(supports: Supports, domain: Domain) -> int:
    """Number of unknowns that the supports leave."""
    zero = np.zeros(domain.layout.size)
    return constraints(supports, domain, lambda _: 0.0, zero, zero, moving=True)[0].size
