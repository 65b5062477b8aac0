"""Whatever befalls a sweep stops the motors, and how long they run on, by the simulator's clock."""

from __future__ import annotations

import numpy as np
import pytest
from sweep_bench import LIMITS, MID_STEP_S, WARM_UP_S, Befallen, Bench, Once

from magcomp.errors import LinkError, LinkTimeoutError, VehicleRefusedError
from magcomp.live.sweep import raise_for_failure
from magcomp.simulate import Faults
from magcomp.sweeping.events import Begun, Reason, Told

AT_ONCE_S = 0.05
"""The next turn of the loop, and the vehicle's next tick."""

TIME_OUT_S = LIMITS.timeout_s + 0.03


def run_on_s(bench, since):
    """How long a motor is driven after a moment; the vehicle is watched for a while more."""
    bench.hear(3.0)
    return bench.cable.last_spun_s - since


def stopped_by(bench, outcome, reason):
    assert outcome.reason is reason
    assert [event for _, event in bench.events][-1] is outcome
    assert bench.vehicle.spinning == ()


# ---------------------------------------------------------------- somebody wants it


@pytest.mark.parametrize("reason", [Reason.KEY, Reason.INTERRUPTED])
def test_a_key_and_ctrl_c_stop_at_once(reason):
    bench, press = Bench(), Once(lambda _: reason)
    stopped_by(bench, bench.sweep(press), reason)
    assert run_on_s(bench, press.at) < AT_ONCE_S


def test_a_key_between_two_steps_begins_no_other():
    bench = Bench()
    between = WARM_UP_S + 4.5
    outcome = bench.sweep(lambda b: Reason.KEY if b.now > between else None)
    stopped_by(bench, outcome, Reason.KEY)
    assert len(outcome.done) == 1
    bench.hear(3.0)
    assert bench.cable.last_spun_s < between


@pytest.mark.parametrize("error", [RuntimeError("a defect"), KeyboardInterrupt()])
def test_an_error_and_a_second_ctrl_c_stop_at_once_and_come_out(error):
    def fail(_):
        raise error

    bench, failure = Bench(), Once(fail)
    with pytest.raises(type(error)):
        bench.sweep(failure)
    assert run_on_s(bench, failure.at) < AT_ONCE_S
    assert bench.machine.outcome.reason is Reason.ERROR


# ---------------------------------------------------------------- the link


def test_after_kill_9_no_command_comes_any_more_and_the_time_out_ends_the_motor():
    class Killed(BaseException):
        pass

    def kill(b):
        # What a killed program would still say, nobody hears.
        b.cable.spoken = False
        raise Killed

    bench, death = Bench(), Once(kill)
    with pytest.raises(Killed):
        bench.sweep(death)
    last = bench.cable.received[-1]
    assert last <= death.at
    assert run_on_s(bench, last) <= TIME_OUT_S
    assert not bench.vehicle.armed


def pull(bench):
    bench.cable.heard = bench.cable.spoken = False


def test_a_pulled_cable_stops_by_the_time_out_and_is_noticed():
    bench, pulled = Bench(), Once(pull)
    outcome = bench.sweep(pulled)
    assert outcome.reason is Reason.LINK_LOST
    assert "no attitude came for 1 s" in outcome.why
    assert run_on_s(bench, pulled.at) <= TIME_OUT_S


def test_a_vehicle_that_is_no_longer_heard_is_told_to_stop():
    def deafen(bench):
        bench.cable.heard = False

    bench, deaf = Bench(), Once(deafen)
    assert bench.sweep(deaf).reason is Reason.LINK_LOST
    assert run_on_s(bench, deaf.at) < LIMITS.attitude_s + AT_ONCE_S


def test_a_vehicle_that_no_longer_hears_stops_by_itself():
    def mute(bench):
        bench.cable.spoken = False

    bench, mute_at = Bench(), Once(mute)
    outcome = bench.sweep(mute_at)
    assert run_on_s(bench, mute_at.at) <= TIME_OUT_S
    assert outcome.reason is Reason.UNANSWERED


def test_a_lost_heartbeat_stops_though_the_rest_still_comes():
    bench = Bench()
    heard = bench.machine.handle
    lost = Once(lambda _: None, not_before=WARM_UP_S + 1.1)

    def without_heartbeats(message, now):
        if lost.at is None or type(message).__name__ != "Heartbeat":
            heard(message, now)

    bench.machine.handle = without_heartbeats
    outcome = bench.sweep(lost)
    assert outcome.reason is Reason.LINK_LOST
    assert "no heartbeat came for 2.5 s" in outcome.why
    assert run_on_s(bench, lost.at) < LIMITS.heartbeat_s + AT_ONCE_S


def test_on_a_link_that_loses_a_third_no_motor_overruns():
    bench = Bench(faults=Faults(loss=0.3, latency_s=0.2))
    bench.sweep(lambda b: Reason.KEY if b.now > 15.0 else None)
    bench.hear(3.0)
    assert bench.cable.longest_s <= LIMITS.hold_s + LIMITS.timeout_s + 0.3
    assert bench.cable.last_spun_s - bench.cable.received[-1] <= TIME_OUT_S


# ---------------------------------------------------------------- the vehicle


@pytest.mark.parametrize(
    ("befallen", "reason", "within_s"),
    [
        (Befallen(MID_STEP_S, tilt_rad=np.radians(8.0)), Reason.TILTED, 0.25),
        (Befallen(MID_STEP_S, turn_rad_s=np.radians(60.0)), Reason.TILTED, 0.45),
        (Befallen(MID_STEP_S, north_m=3.0), Reason.MOVED, 0.35),
    ],
    ids=["tilt", "turn", "position"],
)
def test_a_vehicle_that_does_not_stay_where_it_is_stops_at_once(befallen, reason, within_s):
    bench = Bench(befallen)
    stopped_by(bench, bench.sweep(), reason)
    assert run_on_s(bench, MID_STEP_S) < within_s


def test_an_armed_vehicle_is_refused():
    bench = Bench()
    bench.vehicle.arm()
    bench.hear(1.2)
    stopped_by(bench, bench.sweep(), Reason.ARMED)
    assert bench.cable.received[-1] < bench.now
    assert bench.vehicle.armed, "a vehicle that somebody armed is left alone"


def test_a_vehicle_that_is_armed_between_two_steps_ends_the_sweep():
    bench = Bench()
    armed = []

    def arm(b):
        if b.now > WARM_UP_S + 4.3 and not armed:
            armed.append(b.now)
            b.vehicle.arm()

    stopped_by(bench, bench.sweep(arm), Reason.ARMED)
    assert bench.cable.last_spun_s < armed[0]
    assert bench.vehicle.armed


def test_in_the_air_it_is_refused():
    bench = Bench(name="flight", warm_up_s=20.0)
    outcome = bench.sweep()
    assert outcome.reason is Reason.ARMED
    assert bench.vehicle.spinning == ()
    assert bench.vehicle.armed


def test_what_flies_without_saying_armed_refuses_by_itself():
    bench = Bench(name="flight", warm_up_s=20.0)
    bench.vehicle.disarm()
    bench.hear(1.5)
    outcome = bench.sweep()
    assert outcome.reason in (Reason.REFUSED, Reason.TILTED, Reason.MOVED)
    assert not any(motors for _, motors in bench.cable.spun)


# ---------------------------------------------------------------- how it begins, and what it tells


@pytest.mark.parametrize("typed", ["", "yes", "copter-2", "copter"])
def test_nothing_spins_before_the_name_is_typed(typed):
    bench = Bench()
    bench.sweep(lambda b: Reason.KEY if b.now > 8.0 else None, typed=typed)
    assert not any(motors for _, motors in bench.cable.spun)


def test_each_motor_spins_alone_first_and_gently_and_for_its_time():
    bench = Bench()
    bench.sweep(lambda b: Reason.KEY if b.now > 28.0 else None)
    begun = [event.step for _, event in bench.events if isinstance(event, Begun)]
    assert [step.motors for step in begun[:5]] == [(1,), (2,), (3,), (4,), (1, 2, 3, 4)]
    assert {step.share for step in begun[:5]} == {0.3}
    together = {len(motors) for _, motors in bench.cable.spun}
    assert together == {0, 1, 2, 3, 4}
    assert bench.cable.longest_s == pytest.approx(LIMITS.hold_s, abs=0.05)
    told = [event.measured.current for _, event in bench.events if isinstance(event, Told)]
    assert told[4] == pytest.approx(sum(told[:4]), rel=0.1)


def test_a_vehicle_without_a_current_sensor_ends_after_the_first_step():
    bench = Bench(rates={"ATTITUDE": 10.0})
    assert bench.sweep().reason is Reason.NO_CURRENT


@pytest.mark.parametrize(
    ("reason", "error"),
    [
        (Reason.LINK_LOST, LinkError),
        (Reason.UNANSWERED, LinkTimeoutError),
        (Reason.ARMED, VehicleRefusedError),
    ],
)
def test_an_outcome_becomes_an_error(reason, error):
    bench = Bench(warm_up_s=0.0)
    bench.machine.stop(reason, bench.now, "of this")
    with pytest.raises(error, match="of this"):
        raise_for_failure(bench.machine.outcome)


@pytest.mark.parametrize("reason", [Reason.KEY, Reason.INTERRUPTED])
def test_what_the_user_wanted_is_no_error(reason):
    bench = Bench(warm_up_s=0.0)
    bench.machine.stop(reason, bench.now)
    raise_for_failure(bench.machine.outcome)
