"""Limits of synthetic sequences: orders, noise, no limit, coverage of the uncertainty."""

from __future__ import annotations

import numpy as np
import pytest

from tawami.study.limit import limit_of, sizes_of

HALVED = [1 / 4, 1 / 8, 1 / 16, 1 / 32]


@pytest.mark.parametrize("order", [0.5, 1, 2, 3.7])
@pytest.mark.parametrize("sizes", [HALVED, HALVED[:3], [0.3, 0.2, 0.1, 0.07]])
def test_a_power_is_extrapolated(order, sizes):
    found = limit_of(sizes, [2 + s**order for s in sizes])
    error = sizes[-1] ** order  # of the finest value
    assert abs(found.value - 2) <= min(found.uncertainty, error / 2) + 1e-9
    if len(sizes) > 3:  # a second order confirms the first
        assert found.value == pytest.approx(2, abs=3e-3 * error)
        # a second term of low order hides behind a high order
        assert found.uncertainty < (0.4 if order <= 2 else 3) * error
        assert found.order == pytest.approx(order, abs=0.05)


def test_a_second_source_of_error_is_in_the_bar():
    """h^2.4 minus a smaller term in h: one power fits to 1 %, and its limit would be far off."""
    values = [1 - 0.2 * s**2.4 + 0.003 * s for s in (1 / 4, 1 / 8, 1 / 12, 1 / 16)]
    found = limit_of([1 / 4, 1 / 8, 1 / 12, 1 / 16], values)
    assert abs(found.value - 1) <= found.uncertainty < 3e-4


def test_a_number_that_grows_is_an_inverse_size():
    assert sizes_of([2, 4, 8]) == [1 / 2, 1 / 4, 1 / 8]
    assert sizes_of([0.5, 0.25]) == [0.5, 0.25]
    found = limit_of(sizes_of([2, 3, 5, 8]), [1 + 1 / n**2 for n in (2, 3, 5, 8)])
    assert found.value == pytest.approx(1, abs=1e-5)


def coverage(make):
    """Parts of the sequences of which the interval holds the limit 1, and of which the bound of the
    error of the finest value is at most three times that error.
    """
    covered, narrow = [], []
    for seed in range(60):
        values = make(np.random.default_rng(seed))
        found = limit_of(HALVED, list(values))
        covered.append(abs(found.value - 1) <= found.uncertainty)
        bound = abs(found.value - values[-1]) + found.uncertainty
        narrow.append(bound <= 3 * abs(values[-1] - 1))
    return np.mean(covered), np.mean(narrow)


def test_the_uncertainty_covers_sums_of_powers():
    def two_terms(random):
        p, mixed = random.uniform(0.8, 3), random.uniform(-1, 1)
        s = np.array(HALVED)
        return 1 + 0.1 * (s**p + mixed * s ** (p + 1))

    covered, narrow = coverage(two_terms)
    assert covered >= 0.9
    assert narrow >= 0.9


def test_the_uncertainty_covers_noise():
    covered, _ = coverage(lambda random: 1 + 1e-3 * random.normal(size=4))
    assert covered >= 0.8  # the limit, not the finest value, is 1
    covered, _ = coverage(
        lambda random: 1 + 0.1 * np.array(HALVED) ** 2 * (1 + 0.2 * random.uniform(-1, 1, 4))
    )
    assert covered >= 0.9


def test_repetitions_measure_the_noise():
    sizes, random = np.repeat(HALVED, 4), np.random.default_rng(1)
    noise = 1e-3 * random.normal(size=sizes.size)
    found = limit_of(list(sizes), list(1 + noise))
    assert abs(found.value - 1) <= found.uncertainty < 3e-3
    assert found.deviation == pytest.approx(1e-3, rel=0.5)


@pytest.mark.parametrize(
    "value",
    [
        lambda s: 1 - 0.1 * np.log(s),  # a point support
        lambda s: 1 + s**-0.5,
        lambda s: 1 / s,
        lambda s: s,  # the value itself goes to 0
        lambda s: 1 + 0.1 * (-2) ** np.round(np.log2(1 / s)),
    ],
)
def test_sequences_without_a_limit(value):
    assert not limit_of(HALVED, [float(value(s)) for s in HALVED]).exists


def test_two_values_one_value_and_equal_values():
    assert limit_of([0.5, 0.25], [1.0, 1.1]).uncertainty == pytest.approx(0.1)
    assert limit_of([0.5], [1.0]).value == 1
    assert limit_of(HALVED, [1.0, 1.0, 1.0, 1.0]).uncertainty == 0
    assert limit_of(HALVED, [1.1, 1.0, 1.0, 1.0]).value == 1


def test_a_single_coarse_value_is_left_behind():
    found = limit_of([1e-3, 1e-6, 1e-9], [1.1, 1.0 + 1e-9, 1.0])
    assert abs(found.value - 1) <= found.uncertainty < 0.05
