"""The steps of a sweep tell the motors apart, evenly, and end where enough is known."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from magcomp.sweeping.steps import GENTLE, Measured, next_step, slope_errors


def carried_out(motors, most, full_a=30.0):
    """All steps of a vehicle whose motors draw as a power of the share."""
    done = []
    while (step := next_step(done, motors, most)) is not None:
        draws = full_a * step.share**1.6 * len(step.motors) / motors
        done.append(Measured(step, draws))
    return done


@given(st.integers(1, 8), st.floats(0.2, 0.9), st.floats(0.0, 100.0))
@settings(max_examples=25, deadline=None)
def test_every_motor_is_spun_alone_as_often_as_the_others_and_first_gently(motors, most, full_a):
    done = carried_out(motors, most, full_a)
    alone = [each.step for each in done if len(each.step.motors) == 1]
    strong = [step.motors for step in alone if step.share == most]
    assert len({strong.count((motor,)) for motor in range(1, motors + 1)}) == 1
    for motors_of in {each.step.motors for each in done}:
        shares = [each.step.share for each in done if each.step.motors == motors_of]
        assert shares[0] == pytest.approx(GENTLE * most, abs=1e-4)
        assert set(shares[1:]) == {most}


def test_more_steps_tell_more_until_the_slopes_are_known():
    done = carried_out(4, 0.5)
    errors = [slope_errors(done[:count], 4).max() for count in range(5, len(done) + 1)]
    assert errors == sorted(errors, reverse=True)
    assert errors[-1] < 0.1


def test_motors_that_draw_much_need_fewer_steps():
    assert len(carried_out(4, 0.5, 100.0)) < len(carried_out(4, 0.5, 5.0))


def test_it_ends_where_nothing_is_drawn():
    assert len(carried_out(4, 0.5, 0.0)) <= 5 * 5 + 4
