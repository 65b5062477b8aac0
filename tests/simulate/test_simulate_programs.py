"""Each programme does what a fit needs of it, and ends ready to be written to."""

from __future__ import annotations

import numpy as np
import pytest

from magcomp.errors import UsageError
from magcomp.simulate import PROGRAMS, scenario
from magcomp.simulate.motion import euler

TIMELESS = [name for name in PROGRAMS if not scenario(name, 1).begin().heeds_heading]


def flown(name, seed=2, step=0.05):
    program = scenario(name, seed).begin()
    time = np.arange(0.0, program.duration_s + 5.0, step)
    return time, program.motion(time, 0.0)


@pytest.mark.parametrize("name", PROGRAMS)
def test_begins_and_ends_disarmed_and_without_throttle(name):
    program = scenario(name, 2).begin()
    ends = np.array([0.0, 1.0, program.duration_s + 0.5, program.duration_s + 100.0])
    motion = program.motion(ends, 0.0)
    assert not motion.armed.any()
    assert not motion.throttle.any()


@pytest.mark.parametrize("name", TIMELESS)
def test_is_a_function_of_time_alone(name):
    time, whole = flown(name, step=0.5)
    program = scenario(name, 2).begin()
    for k in (len(time) // 2, 3, len(time) - 4):
        one = program.motion(time[k : k + 1], 1.0)
        np.testing.assert_allclose(one.earth_from_body[0], whole.earth_from_body[k], atol=1e-12)
        assert one.throttle[0] == pytest.approx(whole.throttle[k])


@pytest.mark.parametrize("name", TIMELESS)
def test_moves_without_jumps(name):
    _, motion = flown(name, step=0.01)
    poses = motion.earth_from_body
    turned = np.einsum("nij,nij->n", poses[1:], poses[:-1])
    degrees = np.degrees(np.arccos(np.clip((turned - 1) / 2, -1, 1)))
    assert degrees.max() / 0.01 < 150.0
    assert np.abs(np.diff(motion.position, axis=0)).max() / 0.01 < 20.0


def test_the_turntable_shows_every_direction_to_the_field_at_every_level():
    time, motion = flown("turntable")
    for level in (0.0, 0.15, 0.3, 0.45, 0.6):
        there = motion.armed & (np.abs(motion.throttle - level) < 1e-6)
        down = motion.earth_from_body[there][:, 2, :]
        shares = np.linalg.eigvalsh(down.T @ down / len(down))
        assert shares[0] > 0.1
        assert np.linalg.norm(down.mean(axis=0)) < 0.6
        assert np.ptp(time[there]) > 50.0


def test_the_paper_ends_each_level_with_a_level_turn():
    _, motion = flown("turntable_paper")
    roll, pitch, yaw = np.unwrap(euler(motion.earth_from_body), axis=0).T
    for level in (0.0, 0.2, 0.3):
        there = motion.armed & (np.abs(motion.throttle - level) < 1e-6)
        last = np.flatnonzero(there)[-200:]
        assert np.abs(euler(motion.earth_from_body[last])[:, :2]).max() < 0.01
        assert np.ptp(yaw[last]) > 3.0
    assert len(roll) == len(pitch)


def test_the_sweep_stays_still_while_the_throttle_goes_up_and_down():
    _, motion = flown("sweep")
    np.testing.assert_allclose(
        motion.earth_from_body,
        np.broadcast_to(motion.earth_from_body[0], (len(motion.throttle), 3, 3)),
    )
    assert motion.throttle.max() == pytest.approx(0.6)
    steps = np.sign(np.diff(motion.throttle))
    rising, falling = np.flatnonzero(steps > 0), np.flatnonzero(steps < 0)
    assert rising.max() < falling.min()


def test_the_flight_yaws_all_around_climbs_and_leans_like_a_quadrotor():
    time, motion = flown("flight")
    roll, pitch, yaw = euler(motion.earth_from_body).T
    assert 180.0 <= time[motion.armed][-1] - time[motion.armed][0] <= 300.0
    assert np.histogram(yaw, 12, (-np.pi, np.pi))[0].min() > 0
    assert 10.0 < np.degrees(max(np.abs(roll).max(), np.abs(pitch).max())) < 50.0
    aloft = -motion.position[:, 2] > 10.0
    assert np.ptp(motion.throttle[aloft]) > 0.1
    assert np.abs(motion.velocity[:, 2]).max() > 1.0


def test_an_unknown_programme_is_refused_with_the_known_ones():
    with pytest.raises(UsageError, match=r"one of turntable, .*; instead received 'waltz'"):
        scenario("waltz", 1)
