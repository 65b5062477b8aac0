"""Which flights of many compasses agree is found for all at once, as for each alone."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from magcomp.fleet import agreeing
from magcomp.fleet.agreeing import Agreement, put_together

DEPARTURE_DEG = 1.0


def compass(seed: int, count: int, off: Sequence[int] = (), std: float = 0.02) -> Agreement:
    """Flights of one truth, but for some that are off by 30° of heading."""
    rng = np.random.default_rng(seed)
    motors = np.array([-1.4, 0.8, -1.9]) + std * rng.normal(size=(count, 3))
    motors[list(off), 0] += 5.0
    covariances = np.tile(std**2 * np.eye(3), (count, 1, 1))
    return Agreement(motors, covariances, 0.1, np.arange(count))


def agreed(*every: Agreement) -> list[Agreement]:
    return agreeing.agreeing(put_together(every), DEPARTURE_DEG)


def test_the_flights_that_are_off_are_left_out_and_no_other() -> None:
    (found,) = agreed(compass(1, 12, (3, 7)))
    assert sorted(index for index, _ in found.apart) == [3, 7]
    assert found.among.tolist() == [0, 1, 2, 4, 5, 6, 8, 9, 10, 11]
    np.testing.assert_allclose(found.pooled.motor, [-1.4, 0.8, -1.9], atol=0.05)


def test_a_heavy_flight_that_drags_the_mean_along_is_found() -> None:
    made = compass(2, 9, (4,))
    made.covariances[4] /= 1e4
    (found,) = agreed(made)
    assert [index for index, _ in found.apart] == [4]


def test_no_more_than_a_third_is_left_out() -> None:
    (found,) = agreed(compass(3, 9, (0, 2, 4, 6)))
    assert len(found.apart) <= 3


def test_of_two_that_disagree_both_stay() -> None:
    (found,) = agreed(compass(4, 2, (1,)))
    assert not found.apart


@pytest.mark.parametrize("at_once", [1, 20, 1 << 12])
def test_many_at_once_are_each_as_alone(at_once: int, monkeypatch: pytest.MonkeyPatch) -> None:
    made = [
        compass(seed, count, off, std)
        for seed, (count, off, std) in enumerate(
            [(12, (), 0.02), (12, (3, 7), 0.02), (9, (0,), 0.02), (12, (), 0.5), (1, (), 0.1)] * 2
        )
    ]
    alone = [agreed(each)[0] for each in made]
    monkeypatch.setattr(agreeing, "_AT_ONCE", at_once)
    for one, together in zip(alone, agreed(*made), strict=True):
        assert [index for index, _ in together.apart] == [index for index, _ in one.apart]
        np.testing.assert_allclose(
            [degrees for _, degrees in together.apart], [degrees for _, degrees in one.apart]
        )
        assert together.among.tolist() == one.among.tolist()
        np.testing.assert_allclose(together.pooled.motor, one.pooled.motor)
        np.testing.assert_allclose(together.pooled.covariance, one.pooled.covariance)
