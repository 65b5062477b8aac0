"""Control quantities: the throttle's cut, the thrust curve, and currents rebuilt from outputs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from synthetic import Flown, problem_of

from magcomp.align import controls, reported
from magcomp.align.rebuilt import smoothed
from magcomp.model import (
    CURRENT,
    THROTTLE,
    ParameterChange,
    ParameterHistory,
    Recording,
    Series,
    interpolate,
)

CURVE = {"MOT_THST_EXPO": 0.65, "MOT_SPIN_MIN": 0.15, "MOT_SPIN_MAX": 0.95}
LIMITS = {"MOT_PWM_MIN": 1000.0, "MOT_PWM_MAX": 2000.0}


def history(values: dict[str, float]) -> ParameterHistory:
    return ParameterHistory(tuple(ParameterChange(0.0, n, v) for n, v in values.items()))


def thrust_at(time: np.ndarray) -> np.ndarray:
    return 0.4 + 0.15 * np.sin(time * 1.3) + 0.1 * np.sin(time * 0.31)


def outputs(time: np.ndarray, thrust: np.ndarray) -> Series:
    """Servo outputs of the firmware's thrust curve for a thrust 0 … 1, all motors alike."""
    expo, low, high = CURVE.values()
    curve = (expo - 1 + np.sqrt((1 - expo) ** 2 + 4 * expo * thrust)) / (2 * expo)
    value = np.zeros((len(time), 16))
    value[:, :4] = (1000.0 + 1000.0 * (low + (high - low) * curve))[:, None]
    return Series(time, np.rint(value))


def flying(seconds: float = 120.0, **parts: object) -> Recording:
    """A recording with throttle and outputs but no current."""
    fast, slow = np.arange(0.0, seconds, 0.1), np.arange(0.0, seconds, 0.25)
    percent = np.trunc(100.0 * thrust_at(slow)) / 100.0
    recording = Flown(seconds=seconds).recording()
    return replace(
        recording,
        current=None,
        throttle=Series(slow, percent),
        outputs=outputs(fast, thrust_at(fast)),
        parameters=history(CURVE | LIMITS),
        **parts,
    )


def test_a_throttle_cut_to_whole_per_cent_gets_its_mean_back():
    recording = replace(flying(), outputs=None)
    (control,) = controls(recording)
    error = control.series.value - thrust_at(control.series.time)
    assert abs(error.mean()) < 4 * 0.00289 / np.sqrt(len(error))


@pytest.mark.parametrize("value", [0.0, 1.0])
def test_no_throttle_and_full_throttle_are_exact(value):
    still = Series(np.arange(10.0), np.array([value, 0.5] * 5))
    (control,) = controls(replace(flying(), outputs=None, throttle=still))
    assert control.series.value[0] == value


def test_thrust_through_the_curve_is_the_thrust_demanded():
    found = controls(flying())
    assert [c.origin for c in found] == [
        "reported throttle",
        "motor outputs through the autopilot's thrust curve",
    ]
    exact = found[1].series
    # Outputs are whole microseconds of 800: half of one is under 0.001 of thrust.
    assert np.abs(exact.value - thrust_at(exact.time)).max() < 0.002


def test_outputs_that_do_not_explain_the_throttle_are_not_taken_for_thrust():
    recording = flying()
    wrong = outputs(recording.outputs.time, 0.8 * thrust_at(recording.outputs.time))
    origins = {c.origin for c in controls(replace(recording, outputs=wrong))}
    assert "motor outputs through the autopilot's thrust curve" not in origins


def test_motors_are_found_by_the_function_of_their_outputs():
    recording = flying()
    moved = np.zeros_like(recording.outputs.value)
    moved[:, 8:12] = recording.outputs.value[:, :4]
    moved[:, :4] = 1500.0
    functions = {f"SERVO{n}_FUNCTION": 33.0 + n - 9 for n in range(9, 13)}
    recording = replace(
        recording,
        outputs=Series(recording.outputs.time, moved),
        parameters=history(CURVE | LIMITS | functions),
    )
    exact = controls(recording)[1].series
    assert np.abs(exact.value - thrust_at(exact.time)).max() < 0.002


def test_a_quantity_that_never_changes_is_none():
    recording = flying()
    flat = Series(recording.throttle.time, np.zeros(len(recording.throttle)))
    assert controls(replace(recording, throttle=flat, outputs=None)) == ()


def test_the_reported_form_is_what_the_autopilot_multiplies():
    found = controls(flying())
    assert reported(found) == {THROTTLE: found[0]}


# --- a fast current, sampled slowly -------------------------------------------------------


def fast_current(seed: int) -> tuple[Recording, np.ndarray, np.ndarray]:
    """Outputs at 10 Hz that make a current, which is reported at 1.5 Hz; the truth at 10 Hz."""
    rng = np.random.default_rng(seed)
    seconds = 300.0
    fast = np.arange(0.0, seconds, 0.1)
    # One second's memory: what lies between two samples of the current cannot be interpolated.
    drive = np.zeros(len(fast))
    for k in range(1, len(fast)):
        drive[k] = 0.8 * drive[k - 1] + rng.normal()
    thrust = np.clip(0.4 + 0.06 * drive, 0.05, 0.95)
    series = outputs(fast, thrust)
    duty = (series.value[:, 0] - 1000.0) / 1000.0
    true = 3.0 + 60.0 * duty**2
    slow = np.arange(0, len(fast), 7)
    recording = replace(
        Flown(seconds=seconds).recording(),
        current=Series(fast[slow], true[slow] + rng.normal(scale=0.2, size=len(slow))),
        throttle=None,
        outputs=series,
        parameters=history(LIMITS),
    )
    return recording, fast, true


def slope_against(control: Series, time: np.ndarray, true: np.ndarray) -> float:
    """Slope of something proportional to the true current, regressed on a form of it."""
    inside = slice(20, -20)
    return float(np.polyfit(interpolate(control, time)[inside], true[inside], 1)[0])


def test_a_current_rebuilt_from_the_outputs_does_not_bias_a_slope_where_interpolation_does():
    interpolated, rebuilt = [], []
    for seed in range(12):
        recording, time, true = fast_current(seed)
        found = controls(recording)
        assert [c.kind for c in found] == [CURRENT, CURRENT]
        assert found[1].origin == "battery current, rebuilt from the motor outputs"
        interpolated.append(slope_against(found[0].series, time, true))
        rebuilt.append(slope_against(found[1].series, time, true))
    assert abs(np.mean(interpolated) - 1.0) > 0.02
    assert np.mean(rebuilt) == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize("late", [0.0, 0.1, 0.2])
def test_a_rebuilt_current_is_as_late_as_the_reported_one(late):
    """The fit estimates one lag for a form; rebuilding must not add another."""
    recording, time, true = fast_current(2)
    slow = recording.current.time
    delayed = Series(slow, np.interp(slow - late, time, true))
    rebuilt = controls(replace(recording, current=delayed))[1].series
    inside = slice(20, -20)
    expected = np.interp(rebuilt.time[inside] - late, time, true)
    assert np.std(rebuilt.value[inside] - expected) < 0.15 * np.std(true)


def test_a_rebuilt_current_never_falls_below_nothing():
    recording, _, _ = fast_current(0)
    assert controls(recording)[1].series.value.min() >= 0.0


def test_outputs_that_say_nothing_of_the_current_are_not_used():
    recording, time, _ = fast_current(1)
    rng = np.random.default_rng(9)
    noise = outputs(time, np.clip(0.4 + 0.1 * rng.normal(size=len(time)), 0.05, 0.95))
    assert [c.origin for c in controls(replace(recording, outputs=noise))] == ["battery current"]


def test_readings_in_a_gap_of_the_current_are_left_out():
    recording = Flown(seconds=60.0).recording()
    current = recording.current
    kept = (current.time < 20.0) | (current.time > 40.0)
    torn = replace(recording, current=Series(current.time[kept], current.value[kept]))
    problem = problem_of(torn)
    times = problem.readings.time
    assert not np.any((times > 20.5) & (times < 39.5))
    assert np.any(times < 20.0)
    assert np.any(times > 40.0)


@pytest.mark.parametrize("constant", [0.06, 0.15])
def test_a_current_that_the_monitor_smooths_is_rebuilt_as_it_was_before(constant: float) -> None:
    """A shift in time alone leaves what is smoothed flatter than what disturbs the compass."""
    rng = np.random.default_rng(3)
    time = np.arange(0.0, 120.0, 0.02)
    walk = np.convolve(rng.normal(size=len(time)), np.ones(20) / 20, "same")
    throttle = Series(time, np.clip(0.45 + 0.35 * walk, 0.0, 1.0))
    true = 60.0 * throttle.value**1.5
    smooth = np.empty_like(true)
    smooth[0] = true[0]
    for row in range(1, len(true)):
        smooth[row] = smooth[row - 1] + (true[row] - smooth[row - 1]) * (
            1.0 - np.exp(-0.02 / constant)
        )
    told = Series(time[::10], smooth[::10] + rng.normal(scale=0.1, size=len(time[::10])))
    found = controls(replace(flying(), current=told, throttle=throttle, outputs=None))
    (rebuilt,) = [each for each in found if "rebuilt" in each.origin]
    assert rebuilt.origin == "battery current, rebuilt from the throttle"
    inside = (time > 1.0) & (time < 119.0)
    shifts = np.arange(-0.1, 0.1, 0.01)

    def slope(series: Series) -> float:
        """Of the true current on it, at the shift that fits best, as a fit of lags would find."""
        rows = [np.interp(time[inside] - s, series.time, series.value) for s in shifts]
        best = max(rows, key=lambda row: np.corrcoef(row, true[inside])[0, 1])
        return float(np.polyfit(best, true[inside], 1)[0])

    assert slope(rebuilt.series) == pytest.approx(1.0, abs=0.02)
    assert abs(slope(told) - 1.0) > 0.04


def test_a_smoothing_shorter_than_a_step_of_the_outputs_is_undone_too() -> None:
    """Outputs ten times a second, a monitor that smooths by 0.06 s: 6 % of a slope if ignored."""
    rng = np.random.default_rng(5)
    time = np.arange(0.0, 180.0, 0.01)
    walk = np.convolve(rng.normal(size=len(time)), np.hanning(60), "same")
    thrust = np.clip(0.42 + 0.12 * walk / walk.std(), 0.1, 0.9)
    told = outputs(time, thrust)
    duty = (told.value[:, 0] - 1000.0) / 1000.0
    true = 90.0 * duty**2
    smooth = np.empty_like(true)
    smooth[0] = true[0]
    for row in range(1, len(true)):
        smooth[row] = smooth[row - 1] + (true[row] - smooth[row - 1]) * (1.0 - np.exp(-0.01 / 0.06))
    current = Series(time[::25], smooth[::25] + rng.normal(scale=0.1, size=len(time[::25])))
    often = Series(time[::10], told.value[::10])
    found = controls(replace(flying(180.0), current=current, throttle=None, outputs=often))
    rebuilt = found[1].series
    inside = (time > 1.0) & (time < 179.0)
    rows = [
        np.interp(time[inside] - shift, rebuilt.time, rebuilt.value)
        for shift in np.arange(-0.15, 0.05, 0.01)
    ]
    best = max(rows, key=lambda row: np.corrcoef(row, true[inside])[0, 1])
    assert np.polyfit(best, true[inside], 1)[0] == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize(("period", "noise", "most"), [(5.0, 0.05, 0.2), (60.0, 1.0, 0.16)])
def test_what_outputs_do_not_explain_is_followed_as_closely_as_it_shows(
    period: float, noise: float, most: float
) -> None:
    """A load of 1 A that comes and goes within seconds; a monitor with a noise of 1 A."""
    fast, often = np.arange(0.0, 120.0, 0.1), np.arange(0.0, 120.0, 0.1)
    load = np.sin(2.0 * np.pi * fast / period)
    true = 5.0 + 50.0 * thrust_at(fast) + load
    told = true + noise * np.random.default_rng(0).normal(size=len(often))
    recording = replace(flying(), throttle=None, current=Series(often, told))
    (rebuilt,) = (form for form in controls(recording) if "rebuilt" in form.origin)
    inside = (rebuilt.series.time > 5.0) & (rebuilt.series.time < 115.0)
    error = rebuilt.series.value[inside] - np.interp(rebuilt.series.time[inside], fast, true)
    assert np.sqrt(np.mean(error**2)) < most


@pytest.mark.parametrize("count", [0, 1])
def test_what_was_told_hardly_at_all_is_not_smoothed(count):
    series = Series(np.arange(count, dtype=float), np.full((count, 4), 3.0))
    assert smoothed(series, 0.1) is series


def test_one_time_far_away_does_not_make_a_million_steps_of_a_hundred_values() -> None:
    time = np.append(np.arange(0.0, 10.0, 0.1), 90_000.0)
    series = Series(time, np.ones((len(time), 1)))
    assert smoothed(series, 0.5) is series
