"""Limit of a sequence under refinement, with its uncertainty; no reference is needed.

The model of a value q_i at size s_i is a power law with a second term and a deviation,

    q_i = q* + C s_i^p + B s_i^m + e_i,      e_i normal with the standard deviation  eta D s_i^r,

where D is the range of the values. The second term represents another source of error, as the time step
next to the grid. It may have the smaller order, and a fit of one power does not show it. The deviation
represents cut cells and particles that cross cells. The orders p and m, the size eta of the deviation
and its rate r are unknown. All of them are considered, with their probability given the values (Bayes'
rule; q*, C and B are integrated exactly). The interval of the uncertainty contains q* with a probability
of 90 %. A regular sequence leaves one order and a small deviation, as in Richardson's extrapolation
(1911). An irregular one leaves many orders, and the uncertainty is large. Several values of one size, as
from shifted grids, measure the deviation.

A sequence has no limit if orders below `SLOWEST` are probable: 0 is a logarithm, and with negative
orders the values grow. It has no limit either if the deviation probably grows with refinement, r < 0.

The priors: a limit exists with a probability of 70 %, and then ln p is normal (90 % of the orders are
between 0.6 and 4). eta is uniform in its logarithm, r is one of `RATES` and rarely negative, and m is
one of `SECOND`. B is normal with the standard deviation `SHARE` D, and the change by C over the sizes
with 2 D. `SHARE` was chosen with the lines of `cases.costs.trade.coverage` and of `held_out.SEEN` in
view.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import brentq
from scipy.special import ndtr

from tawami.base.arrays import Array

#: Orders p, sizes eta and rates r of deviations. The range is about twice the deviation of pure noise.
ORDERS = np.linspace(-1.0, 6.0, 71)
DEVIATIONS = 10.0 ** np.arange(-2.5, -0.24, 0.25)
RATES = np.array([-1.0, 0.0, 1.0, 2.0, 3.0, 4.0])
#: Probability of each rate before values are known.
LIKELY = np.array([0.05, 0.19, 0.19, 0.19, 0.19, 0.19])
#: Orders of the second term, and its standard deviation at the coarsest size over the range.
SECOND, SHARE = np.array([1.0, 2.0, 3.0]), 0.3
#: Deviations below this part of the range are not told apart.
LEAST = 1e-6
#: Orders below this one are no sign of a limit; their probability before values are known.
SLOWEST, WITHOUT = 0.3, 0.3
#: Median of the orders of other sequences, and standard deviation of its logarithm.
USUAL, SPREAD = 1.5, 0.6
#: Probability of the interval, and that above which a sequence of at least `ENOUGH` sizes has no limit.
INSIDE, SURE, ENOUGH = 0.9, 0.8, 4
#: Changes below this part of the value are round-off.
ROUND_OFF = 1e-11
#: Part of the value that the error of the finest run may have.
FARTHEST = 0.5


@dataclass(frozen=True)
class Limit:
    """Limit of a sequence.

    Attributes:
        value: The estimate.
        uncertainty: The limit is expected within value +- uncertainty; infinite without a limit.
        order: Mean observed order; None if it is not known.
        deviation: Mean standard deviation of values from a power law at the finest size; NaN if it is
            not known.
    """

    value: float
    uncertainty: float
    order: float | None = None
    deviation: float = math.nan

    @property
    def exists(self) -> bool:
        """Whether the sequence shows signs of a limit."""
        return math.isfinite(self.uncertainty)


def sizes_of(values: Sequence[Any]) -> list[float]:
    """Positive sizes that decrease with refinement: those of a knob, or the inverse of a growing number.

    Args:
        values: Of the knob, from coarse to fine; distinct positive numbers in order.
    """
    if values[-1] > values[0]:
        return [1 / v for v in values]
    return [float(v) for v in values]


def limit_of(sizes: Sequence[float], values: Sequence[float]) -> Limit:
    """Estimate the limit of values for a size that goes to 0.

    Args:
        sizes: Positive sizes that do not increase; a size may have several values.
        values: Value for each of them.
    """
    steps = np.abs(np.diff(values))
    different = len(set(sizes))
    if len(values) == 1:
        return Limit(values[0], 0.0)
    if np.all(steps[-2:] <= ROUND_OFF * np.abs(values).max()):
        return Limit(values[-1], 2 * float(steps[-2:].max()))
    if different < 3:
        return Limit(values[-1], float(np.ptp(values)))
    limit = _Posterior(np.asarray(sizes, float), np.asarray(values, float)).limit()
    far = abs(limit.value - values[-1]) + limit.uncertainty > FARTHEST * abs(limit.value)
    return Limit(values[-1], math.inf) if far else limit


def _prior() -> Array:
    """Logarithm of the probability of each order before values are known."""
    converges = ORDERS >= SLOWEST
    logs = np.log(ORDERS[converges])
    density = np.exp(-(((logs - np.log(USUAL)) / SPREAD) ** 2) / 2 - logs)
    found = np.full(ORDERS.shape, WITHOUT / np.count_nonzero(~converges))
    found[converges] = (1 - WITHOUT) * density / density.sum()
    return np.asarray(np.log(found))


class _Posterior:
    """Probabilities of orders and of kinds of deviations, with the limit that each of them implies.

    Arrays have the axes order p, kind; a kind is a size eta, a rate r and an order m of the second term.

    Args:
        sizes: Sizes; shape (n,).
        values: Values; shape (n,).
    """

    def __init__(self, sizes: Array, values: Array) -> None:
        self.finest, self.range = float(values[-1]), float(np.ptp(values))
        self.enough = len(np.unique(sizes)) >= ENOUGH
        y, t = (values - self.finest) / self.range, np.log(sizes / sizes.max())
        last = float(t.min())  # logarithm of the finest size over the coarsest
        size, rate, second = map(np.ravel, np.meshgrid(DEVIATIONS, RATES, SECOND))
        self.grows = rate < 0
        growth = np.where(self.grows, rate * (t[:, None] - last), rate * t[:, None])  # (n, kind)
        deviation = np.maximum(size * np.exp(growth), LEAST).T
        other = SHARE * np.exp(np.outer(second, t))
        covariance = other[:, :, None] * other[:, None, :]
        covariance[:, range(len(t)), range(len(t))] += deviation**2
        # weighted regression of y on b, where the prior of A has the standard deviation 2:
        # q = f + A b with b = 1 at the coarsest size and 0 at the finest one; the limit is f - A beyond
        p = np.where(ORDERS == 0, 1e-9, ORDERS)[:, None]
        b = np.expm1(p * (t - last)) / np.expm1(-p * last)
        beyond = 1 / np.expm1(-p * last)
        weight = np.linalg.inv(covariance)  # (kind, n, n)
        ones = weight.sum(-1)
        total = ones.sum(-1)
        centre, mean = b @ ones.T / total, ones @ y / total
        apart = b[:, None, :] - centre[..., None]  # (order, kind, n)
        weighted = np.einsum("pki,kij->pkj", apart, weight)
        spread = (weighted * apart).sum(-1) + 1 / 4
        change = (weighted @ y) / spread
        rest = y - mean[:, None] - change[..., None] * apart
        misfit = np.einsum("pki,kij,pkj->pk", rest, weight, rest) + change**2 / 4
        log = -np.linalg.slogdet(covariance)[1] - np.log(total * spread) - misfit
        log = _prior()[:, None] + np.log(LIKELY[np.searchsorted(RATES, rate)]) + log / 2
        self.probability = np.exp(log - log.max())
        self.probability /= self.probability.sum()
        self._mean = mean - change * (beyond + centre)
        self._deviation = np.sqrt(1 / total + (beyond + centre) ** 2 / spread)
        self._noise = size * np.where(self.grows, 1.0, np.exp(rate * last))

    def limit(self) -> Limit:
        """Median of the limit, with its uncertainty."""
        converges = ORDERS >= SLOWEST
        without = self.probability[~converges].sum(), self.probability[:, self.grows].sum()
        if self.enough and max(without) > SURE:
            return Limit(self.finest, math.inf)
        weight = self.probability[converges] / self.probability[converges].sum()
        mean, deviation = self._mean[converges], self._deviation[converges]
        ends = float((mean - 9 * deviation).min()), float((mean + 9 * deviation).max())

        def quantile(part: float) -> float:
            def excess(x: float) -> float:
                return float((weight * ndtr((x - mean) / deviation)).sum()) - part

            return float(brentq(excess, *ends, xtol=1e-12 * (ends[1] - ends[0])))

        low, median, high = map(quantile, ((1 - INSIDE) / 2, 0.5, (1 + INSIDE) / 2))
        order = float(weight.sum(1) @ ORDERS[converges])
        noise = float(weight.sum(0) @ self._noise)
        return Limit(
            self.finest + self.range * median, self.range * max(high - median, median - low),
            order, self.range * noise,
        )  # fmt: skip
