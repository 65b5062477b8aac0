"""Each limit of judge/thresholds.py from both sides, and what beyond it is said."""

from __future__ import annotations

from importlib import import_module
from types import SimpleNamespace

import numpy as np
import pytest

from magcomp.judge import present, whole
from magcomp.judge.constancy import Departure
from magcomp.judge.gates import on_control, on_duration, on_turn
from magcomp.judge.thresholds import Thresholds
from magcomp.model import CURRENT, THROTTLE, Coverage, FieldResidual, Grade, HeadingError

judging = import_module("magcomp.judge.judge")  # the package's `judge` is the function in it

LIMITS = Thresholds()
GOOD, MARGINAL, REJECTED = Grade.GOOD, Grade.MARGINAL, Grade.REJECTED


def grade(findings) -> Grade:
    """The worst of some findings."""
    found = {finding.grade for finding in findings}
    return REJECTED if REJECTED in found else MARGINAL if MARGINAL in found else GOOD


def covered(low=2.0, high=40.0, heading=1.0, seconds=200.0) -> Coverage:
    return Coverage(
        sphere=0.3, heading=heading, tilt_deg=20.0, u_low=low, u_high=high, seconds=seconds,
        u_median=20.0,
    )  # fmt: skip


def fit(method="flight", **values) -> SimpleNamespace:
    usual = {"strength": 500.0, "vertical": 300.0, "line": None, "levels": (), "u_high": 40.0}
    return SimpleNamespace(**{**usual, "method": method, "regressor": CURRENT, **values})


def errors(before: float, p95: float) -> tuple[HeadingError, ...]:
    return tuple(HeadingError(u, before, p95 / 2, p95) for u in (0.0, 20.0, 40.0))


def left(held_out: float, before: float) -> FieldResidual:
    return FieldResidual(before, held_out, held_out, before)


@pytest.mark.parametrize(
    ("p95", "before", "expected"),
    [
        (1.99, 30.0, GOOD),
        (2.01, 30.0, MARGINAL),
        (5.99, 1.0, MARGINAL),
        (6.01, 1.0, REJECTED),
        (9.9, 30.0, MARGINAL),
        (10.1, 30.0, REJECTED),
        (19.9, 90.0, MARGINAL),
        (20.1, 90.0, REJECTED),
    ],
)
def test_the_bound_is_good_marginal_the_lesser_evil_or_useless(monkeypatch, p95, before, expected):
    monkeypatch.setattr(judging, "lacking", lambda *_: "record longer")
    table = errors(before, p95)
    assert grade(judging._on_bound(fit(), table, table[-1], (None, covered()), LIMITS)) is expected


@pytest.mark.parametrize(("at_rest", "expected"), [(19.9, MARGINAL), (20.1, REJECTED)])
def test_a_sweep_that_knows_the_motors_is_useless_without_a_calibration(at_rest, expected):
    table = errors(30.0, at_rest)
    swept = judging._on_bound(fit("sweep"), table, table[-1], (None, covered()), LIMITS)
    assert grade(swept) is expected


@pytest.mark.parametrize(
    ("held_out", "expected"), [(94.0, GOOD), (96.0, MARGINAL), (101.0, REJECTED)]
)
def test_a_fit_that_claims_a_change_must_explain_unseen_data_better(held_out, expected):
    residual = left(held_out, 100.0)
    assert grade(judging._on_unseen(fit(), errors(30.0, 1.0), residual, LIMITS)) is expected
    assert grade(judging._on_unseen(fit(), errors(0.5, 1.0), residual, LIMITS)) is GOOD


@pytest.mark.parametrize(
    ("held_out", "before", "expected"),
    [(19.0, 19.0, GOOD), (21.0, 29.0, MARGINAL), (21.0, 27.0, REJECTED)],
)
def test_what_stays_unexplained_must_be_little_or_worthwhile(held_out, before, expected):
    found = judging._on_shape(fit(), left(held_out, before), covered(), LIMITS, known=True)
    assert grade(found) is expected


@pytest.mark.parametrize(("rms", "expected"), [(14.0, GOOD), (16.0, MARGINAL)])
@pytest.mark.parametrize("noise", [1.0, 20.0])
def test_centres_off_their_line_by_more_than_their_noise_are_told(rms, expected, noise):
    line = SimpleNamespace(rms=rms, positions=np.array([0.0, 50.0, 100.0]))
    levels = (SimpleNamespace(covariance=noise**2 * np.eye(3)),) * 3
    of = fit("levels", line=line, levels=levels)
    found = judging._on_shape(of, left(1.0, 9.0), covered(), LIMITS, known=True)
    assert grade(found) is (expected if noise == 1.0 else GOOD)


@pytest.mark.parametrize(
    ("heading", "known", "expected"),
    [
        (0.61, False, GOOD),
        (0.59, False, MARGINAL),
        (0.26, False, MARGINAL),
        (0.24, False, REJECTED),
        (0.24, True, MARGINAL),
    ],
)
def test_the_vehicle_must_have_turned(heading, known, expected):
    assert grade(on_turn(covered(heading=heading), LIMITS, known=known)) is expected


@pytest.mark.parametrize(
    ("kind", "low", "high", "known", "expected"),
    [
        (CURRENT, 20.0, 25.1, True, GOOD),
        (CURRENT, 20.0, 24.9, True, MARGINAL),
        (CURRENT, 20.0, 24.9, False, REJECTED),
        (CURRENT, 0.0, 4.9, True, REJECTED),
        (THROTTLE, 0.3, 0.43, True, GOOD),
        (THROTTLE, 0.3, 0.41, True, MARGINAL),
        (THROTTLE, 0.1, 0.21, True, REJECTED),
    ],
)
def test_the_motors_must_have_worked_harder_at_times_than_at_others(
    kind, low, high, known, expected
):
    assert grade(on_control(kind, covered(low, high), LIMITS, known=known)) is expected


@pytest.mark.parametrize(("seconds", "expected"), [(12.1, GOOD), (11.9, REJECTED)])
def test_a_calibration_in_force_is_judged_by_twelve_seconds_at_least(seconds, expected):
    assert grade(on_duration(covered(seconds=seconds), LIMITS)) is expected


@pytest.mark.parametrize(
    ("before", "p95", "expected"),
    [
        (1.9, 5.9, GOOD),
        (1.9, 6.1, MARGINAL),
        (2.1, 3.0, MARGINAL),
        (5.9, 9.0, MARGINAL),
        (6.1, 7.0, REJECTED),
    ],
)
def test_the_calibration_in_force_is_judged_by_its_error_and_its_bound(before, p95, expected):
    assert present._measured(errors(before, p95), CURRENT, LIMITS).grade is expected
    assert present._measured((), CURRENT, LIMITS).grade is REJECTED


@pytest.mark.parametrize(
    ("kind", "degrees", "std", "expected"),
    [
        ("curve", 0.9, 0.1, GOOD),
        ("curve", 1.1, 0.1, MARGINAL),
        ("curve", 6.1, 0.1, REJECTED),
        ("curve", 1.7, 0.55, MARGINAL),
        ("curve", 1.7, 0.58, GOOD),
        ("motors", 1.7, 0.47, MARGINAL),
        ("motors", 1.7, 0.5, GOOD),
    ],
)
def test_a_plain_departure_from_the_model_is_told(monkeypatch, kind, degrees, std, expected):
    departure = Departure(kind, degrees, std, 5.0, float("nan"), 1.0)
    monkeypatch.setattr(whole, "departures_of", lambda *_: (departure,))
    monkeypatch.setattr(whole, "used_lags", lambda _: None)
    problem = SimpleNamespace(
        control=SimpleNamespace(kind=CURRENT), readings=SimpleNamespace(stretch=np.zeros(9))
    )
    assert grade(whole.on_constancy(problem, fit(), LIMITS, 1.0)) is expected
    assert grade(whole.on_constancy(problem, fit("sweep"), LIMITS, 1.0)) is GOOD


@pytest.mark.parametrize(
    ("held", "mgauss_per_a", "bend_deg", "bound", "expected"),
    [
        ((2.0, 42.0), 1.2, 4.0, 0.5, MARGINAL),
        ((2.0, 42.0), 0.6, 4.0, 0.5, GOOD),
        ((2.0, 42.0), 0.6, 4.0, 1.8, MARGINAL),
        ((2.0, 42.0), 1.2, 0.5, 0.5, GOOD),
        ((2.0, 22.0, 42.0), 1.2, 4.0, 0.5, GOOD),
    ],
    ids=["strong motors", "weak motors", "weak and unsure", "ruled out", "three levels"],
)
def test_two_levels_do_not_show_that_the_shift_is_straight(
    monkeypatch, held, mgauss_per_a, bend_deg, bound, expected
):
    """A quarter of 40 A × 1.2 mGauss is 12, or 2.7° of 250 mGauss horizontal; of 0.6, 1.4°."""
    departure = Departure("curve", bend_deg / 2, bend_deg / 4, 5.0, float("nan"), 1.0)
    monkeypatch.setattr(whole, "departures_of", lambda *_: (departure,))
    monkeypatch.setattr(whole, "used_lags", lambda _: None)
    problem = SimpleNamespace(
        control=SimpleNamespace(kind=CURRENT), readings=SimpleNamespace(stretch=np.zeros(9))
    )
    of = fit(
        "levels",
        levels=tuple(SimpleNamespace(u=u) for u in held),
        correction=SimpleNamespace(vector=np.array([mgauss_per_a, 0.0, 0.0])),
        strength=500.0,
        vertical=433.0,
    )
    assert grade(whole.on_constancy(problem, of, LIMITS, bound)) is expected


@pytest.mark.parametrize(
    ("share", "dip_deg", "expected"),
    [
        (1.0, 60.0, GOOD),
        (0.36, 60.0, GOOD),
        (0.34, 60.0, REJECTED),
        (2.4, 60.0, GOOD),
        (2.6, 60.0, REJECTED),
        (1.0, 20.0, REJECTED),
    ],
)
def test_the_field_must_be_an_earths_at_the_place_of_the_log(share, dip_deg, expected):
    problem = SimpleNamespace(earth=SimpleNamespace(strength=500.0, dip=np.radians(60.0)))
    samples = SimpleNamespace(present=np.tile([0.0, 0.0, 500.0 * share], (9, 1)))
    of = fit(vertical=500.0 * np.sin(np.radians(dip_deg)))
    assert grade(whole.on_earth(problem, samples, of)) is expected
