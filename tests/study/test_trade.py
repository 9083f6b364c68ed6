"""Trades: limits with several knobs, the order of runs, budgets, tables, wrong input."""

from __future__ import annotations

import csv
import io
import math
from typing import Annotated

import numpy as np
import pytest

import tawami
from tawami.study import front_figure, process
from tawami.study.adjoint import combined
from tawami.study.estimate import Estimate, estimate
from tawami.study.knobs import Knob, applied, knobs_of

H = (1 / 4, 1 / 8, 1 / 16, 1 / 32)


# -- functions with knobs ----------------------------------------------------------


def quadratic(
    h: Annotated[float, H] = 1 / 8,
    alpha: Annotated[float, (0.1, 0.03, 0.01)] = 0.03,
    load: float = 2.0,
):
    """Converge to the load with h, faster with a small alpha; the effect of alpha vanishes with h."""
    return {"tip": load + (0.3 + 10 * alpha) * h**2, "seconds": 0.002 / h}


def singular(h: Annotated[float, H] = 1 / 8, n: Annotated[int, (2, 4, 8)] = 4):
    return {"tip": 1 + h**-0.5 + 1 / n**2}


def singular_and_regular(h: Annotated[float, H] = 1 / 8):
    return {"tip": 1 + h**2, "stress": h**-0.5}


def loaded(h: Annotated[float, H] = 1 / 8, load: Annotated[float, (1.0, 2.0, 4.0)] = 1.0):
    return {"tip": load * (1 + h**2)}


def forms(h: Annotated[float, H] = 1 / 8, form: Annotated[str, ("good", "other")] = "good"):
    return {"tip": (1.0 if form == "good" else 1.5) + h**2}


def fails_when_coarse(h: Annotated[float, H] = 1 / 16):
    if h > 1 / 5:
        raise tawami.InputError("h is too large")
    return {"tip": 1 + h**2}


def fails_when_fine(h: Annotated[float, H] = 1 / 8):
    if h < 1 / 5:
        raise tawami.InputError("the footing sinks")
    return {"tip": 1 + h**2}


def shifted(h: Annotated[float, H] = 1 / 8, shift: Annotated[float, {0.3, 0.0, 0.7}] = 0.0):
    return {"tip": 1 + 0.01 * h * np.sin(40 * shift + 7 / h)}


def always_fails(h: Annotated[float, H] = 1 / 8):
    raise tawami.InputError(f"no h = {h} is possible")


def text(h: Annotated[float, H] = 1 / 8):
    return {"tip": "long"}


def profile(h: Annotated[float, H] = 1 / 8):
    return {"tip": [h, h]}


def no_knobs(h: float = 1 / 8):
    return {"tip": h}


def one_value(h: Annotated[float, 0.1] = 0.1):
    return {"tip": h}


def no_default(h: Annotated[float, H]):
    return {"tip": h}


def only_names(form: Annotated[str, ("u", "u_epsv")] = "u"):
    return {"tip": 1.0}


FUNCTIONS = {name: value for name, value in globals().items() if callable(value)}


@pytest.fixture
def runs(monkeypatch):
    """Run functions here, each in a second of the clock; the knobs of the runs, in order."""
    done = []
    monkeypatch.setattr("tawami.study.ladder.perf_counter", lambda: float(len(done)))

    def measure(name, knobs, limit, threads):
        done.append(dict(knobs))
        try:
            values = process._plain(FUNCTIONS[name.partition(":")[2]](**knobs))
        except tawami.InputError as error:
            return {"failure": f"InputError: {error}"}
        wall = values.pop("seconds", 0.01)
        if wall > limit:
            return {"failure": "took longer", "cut": True}
        return {"values": values, "wall_s": wall, "peak_MB": 100.0}

    monkeypatch.setattr(process, "measure", measure)
    monkeypatch.setattr(front_figure, "picture", lambda *_: None)
    return done


def traded(function, tmp_path, budget=600.0, **options):
    options = {"folder": tmp_path, "quiet": True, "jobs": 1} | options
    return tawami.trade(function, "tip", budget, **options)


# -- estimates ---------------------------------------------------------------------


def test_an_error_that_vanishes_with_h_does_not_count_twice():
    knobs = knobs_of(quadratic)
    points = {(h, a): quadratic(h, a)["tip"] for h in knobs[0].values for a in knobs[1].values}
    found = estimate("tip", knobs, points)
    assert found.value == pytest.approx(2, abs=1e-7)
    assert found.orders["h"] == pytest.approx(2, abs=0.01)
    assert found.remarks == ()


def test_an_error_that_stays_is_extrapolated_too():
    knobs = [Knob("h", H, 1 / 8), Knob("dt", (0.2, 0.1, 0.05, 0.025), 0.1)]
    points = {(h, dt): 1 + h**2 + 0.01 * dt for h in H for dt in knobs[1].values}
    found = estimate("tip", knobs, points)
    assert abs(found.value - 1) <= found.uncertainty + 1e-12
    assert found.uncertainty < 2e-3
    assert found.orders == pytest.approx({"h": 2, "dt": 1}, abs=0.01)


@pytest.mark.parametrize(
    ("parts", "order", "value", "uncertainty", "remarks"),
    [
        ({"grid": 0.01, "particles": -0.002}, 2.0, 1.008, 0.012 * 3 / 7, 0),
        ({"grid": 0.01}, math.nan, 1.01, 0.01 * 3 / 7, 0),
        ({"grid": 0.01}, 0.0, 1.01, 0.02, 0),  # shows no limit
        ({"grid": 0.06, "particles": -0.04}, 2.0, 1.01, 0.02, 0),  # too uncertain
        (
            {"grid": 0.06},
            2.0,
            (0.99 + 1.06 + 0.06 * 3 / 7) / 2,
            (1.06 + 0.06 * 3 / 7 - 0.99) / 2,
            1,
        ),
    ],
)
def test_the_error_of_one_solve_narrows_the_bar(parts, order, value, uncertainty, remarks):
    refined, knobs = Estimate(1.01, 0.02), [Knob("h", H, 1 / 8)]
    errors = {(1 / 8,): {"parts": parts, "order": order}}
    found = combined("tip", knobs, refined, {(1 / 8,): 1.0}, errors)
    assert found.value == pytest.approx(value, abs=1e-8)
    assert found.uncertainty == pytest.approx(uncertainty, abs=1e-8)
    assert len(found.remarks) == remarks


def test_one_size_has_no_estimate():
    (remark,) = estimate("tip", [Knob("h", H, 1 / 8)], {(1 / 8,): 1.0}).remarks
    assert remark.startswith("'tip' has no error estimate: fewer than two runs with values of 'h'")


# -- trades ------------------------------------------------------------------------


@pytest.mark.usefixtures("runs")
def test_errors_the_recommended_setting_and_the_files(tmp_path):
    trade = traded(quadratic, tmp_path)
    assert trade.converges
    for run in trade.succeeded:
        true = abs(run.values["tip"] - 2) / 2
        assert abs(run.error - true) <= run.uncertainties["tip"] + 1e-12
        assert run.bound <= 3 * true
    chosen = trade.recommended()
    assert abs(chosen.values["tip"] / 2 - 1) <= 0.01
    assert trade.default.knobs == {"h": 1 / 8, "alpha": 0.03}
    lines = str(trade).splitlines()
    assert lines[0].split() == ["setting", "tip", "time", "memory"]
    assert len(lines[: lines.index("")]) <= 1 + 8 + 1
    assert "1 % costs" in trade.sentence()
    rows = list(csv.DictReader(io.StringIO((tmp_path / "quadratic.csv").read_text())))
    assert len(rows) == len(trade.runs)
    assert rows[0].keys() == {
        "h", "alpha", "tip", "tip, error", "tip, uncertainty", "wall_s", "peak_MB", "failure"
    }  # fmt: skip
    with pytest.raises(tawami.InputError, match=r"no run of 'quadratic' is within 1e-07 %"):
        trade.recommended(1e-9)


def test_cheap_settings_run_first_and_stored_runs_are_not_repeated(tmp_path, runs):
    first = traded(quadratic, tmp_path)
    sizes = [run["h"] for run in runs if run["alpha"] == 0.03]
    assert sizes[0] == 1 / 4
    assert sizes[-1] == 1 / 32
    before = len(runs)
    assert traded(quadratic, tmp_path).runs == first.runs
    assert len(runs) == before


def test_a_larger_budget_continues(tmp_path, runs):
    few = traded(quadratic, tmp_path, budget=4.5)
    assert 2 <= len(few.runs) < 6
    before = len(runs)
    more = traded(quadratic, tmp_path, budget=100.0)
    assert len(more.runs) == len(runs) > before
    settings = [tuple(run.values()) for run in runs]
    assert len(set(settings)) == len(settings)


@pytest.mark.usefixtures("runs")
def test_no_limit_is_reported(tmp_path):
    trade = traded(singular, tmp_path)
    assert not trade.converges
    assert "'tip' does not converge with 'h'" in trade.sentence()
    assert "no limit" in str(trade)
    with pytest.raises(tawami.InputError, match="the problem has no limit, or 'h' changes the pro"):
        trade.recommended()


@pytest.mark.usefixtures("runs")
@pytest.mark.parametrize(
    ("function", "message"),
    [
        (loaded, "'tip' does not converge with 'load'"),
        (
            forms,
            "converges to 1.5 with form other, and to 1 with form good: 'form' changes the problem",
        ),
    ],
)
def test_a_knob_that_changes_the_problem_is_reported(tmp_path, function, message):
    assert message in traded(function, tmp_path).sentence()


def test_an_alternative_may_need_a_finer_grid():
    """Values with 'u' may converge with h, which is not refined there: alpha has the largest effect."""
    knobs = [
        Knob("alpha", (2.5, 0.5, 0.1), 0.1), Knob("h", H, 1 / 8),
        Knob("form", ("u_epsv", "u"), "u_epsv"),
    ]  # fmt: skip
    points = {(a, h, "u_epsv"): 1 + a * h**2 for a in knobs[0].values for h in H}
    points |= {(a, 1 / 8, "u"): 1 - 5 / 8**2 for a in knobs[0].values}
    (remark,) = estimate("tip", knobs, points).remarks
    assert remark.endswith("'form' changes the problem, or h 0.125 is too coarse to tell.")


def test_quantities_with_a_limit_are_named(tmp_path, runs):
    trade = tawami.trade(singular_and_regular, folder=tmp_path, quiet=True, jobs=1)
    assert trade.sentence().endswith("'tip' alone has a limit: see --quantity tip.")
    only = tawami.trade(singular_and_regular, "tip", folder=tmp_path, quiet=True, jobs=1)
    assert only.recommended().bound <= 0.01  # the advice
    assert len(runs) == 4


@pytest.mark.usefixtures("runs")
def test_runs_that_fail_are_shown(tmp_path):
    trade = traded(fails_when_coarse, tmp_path)
    assert trade.estimates["tip"].value == pytest.approx(1, abs=1e-5)
    assert (
        "1 of 4 runs failed, the first with h 0.25: InputError: h is too large" in trade.sentence()
    )


@pytest.mark.usefixtures("runs")
def test_no_limit_if_finer_runs_fail(tmp_path):
    trade = traded(fails_when_fine, tmp_path, knobs={"h": (1 / 2, 1 / 4, 1 / 8, 1 / 16)})
    assert not trade.converges
    assert "does not converge with 'h': runs with 0.125 and finer fail (Inp" in trade.sentence()


@pytest.mark.usefixtures("runs")
def test_repetitions_with_shifts(tmp_path):
    trade = traded(shifted, tmp_path)
    assert trade.knobs[1].values == (0.0, 0.3, 0.7)
    found = trade.estimates["tip"]
    assert len(trade.succeeded) == 12
    assert abs(found.value - 1) <= found.uncertainty < 2e-3
    assert found.remarks == ()


def test_jobs_change_no_result(tmp_path, runs):
    one, two = (traded(quadratic, tmp_path / str(jobs), jobs=jobs) for jobs in (1, 2))
    assert one.as_csv() == two.as_csv()
    assert len(runs) == 2 * len(one.runs)


@pytest.mark.usefixtures("runs")
@pytest.mark.parametrize(
    ("function", "message"),
    [
        (
            no_knobs,
            "no_knobs has no knobs: expected an argument with its values from coarse to fine",
        ),
        (no_default, "argument 'h' of no_default has no default"),
        (only_names, "no knob of only_names refines"),
        (one_value, "knob 'h' = 0.1: expected its values from coarse to fine, as h: Annotated"),
        (text, "quantity 'tip' = 'long': expected real numbers"),
        (profile, "quantity 'tip' of 'profile' is a list: expected a number"),
        (always_fails, "finds no limit: 3 runs failed, the first with h 0.25: InputError: no h = "),
    ],
)
def test_wrong_input(tmp_path, function, message):
    with pytest.raises(tawami.InputError) as error:
        traded(function, tmp_path)
    assert message in str(error.value)


@pytest.mark.usefixtures("runs")
def test_a_budget_for_less_than_two_runs(tmp_path):
    with pytest.raises(tawami.InputError, match=r"budget = 0.9 s is too small .* at least 4 s"):
        traded(quadratic, tmp_path, budget=0.9)
    assert len(traded(quadratic, tmp_path, budget=4.0).succeeded) >= 2  # the advice


@pytest.mark.usefixtures("runs")
def test_knobs_may_be_declared(tmp_path):
    trade = traded(no_knobs, tmp_path, knobs={"h": [0.4, 0.2, 0.1]})
    assert [knob.values for knob in trade.knobs] == [(0.4, 0.2, 1 / 8, 0.1)]
    with pytest.raises(tawami.InputError, match=r"knob 'H': expected an argument of no_knobs"):
        traded(no_knobs, tmp_path, knobs={"H": [0.4, 0.2]})


def test_a_setting_is_applied_to_the_source():
    source = (
        "def build(h: Annotated[float, (1/2, 1/4)] = 1 / 2,  # é\n"
        "          n=(\n    3\n), *, form='u', é=1):\n    return {}\n"
    )
    found = applied(source, "build", {"h": 0.25, "n": 4, "form": "u_epsv"})
    assert found == (
        "def build(h: Annotated[float, (1/2, 1/4)] = 0.25,  # é\n"
        "          n=(\n    4\n), *, form='u_epsv', é=1):\n    return {}\n"
    )
