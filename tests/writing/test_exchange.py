"""Questions under way, and the fence behind which answers are believed."""

from __future__ import annotations

import pytest

from magcomp.writing.exchange import Exchange, Timing
from magcomp.writing.fence import Fence
from magcomp.writing.messages import Pong

TIMING = Timing()
RECEIVE_QUEUE = 20
"""Reads that ArduPilot holds; it drops the rest (docs/autopilots.md, ArduPilot: parameters)."""


def test_no_more_questions_wait_than_the_autopilot_holds():
    exchange = Exchange(range(100), TIMING)
    asked = exchange.ask(0.0)
    assert 1 <= len(asked) <= RECEIVE_QUEUE - 8  # other programs ask as well
    assert exchange.ask(0.1) == []
    assert exchange.answer(0)
    assert [key for key, _ in exchange.ask(0.1)] == [len(asked)]


def test_a_question_is_asked_again_until_it_is_given_up():
    exchange = Exchange(("a",), TIMING)
    times = [1.01 * n * TIMING.retry_after for n in range(2 * TIMING.attempts)]
    assert [len(exchange.ask(now)) for now in times] == [1] * TIMING.attempts + [
        0
    ] * TIMING.attempts
    assert exchange.unanswered(times[-1]) == ("a",)


def test_an_answer_to_what_was_never_asked_answers_nothing():
    exchange = Exchange(range(100), TIMING)
    exchange.ask(0.0)
    assert not exchange.answer(99)
    assert exchange.differ(99) == 0
    assert exchange.answered == 0


def test_another_answer_counts_once_an_asking():
    exchange = Exchange(("a",), TIMING)
    exchange.ask(0.0)
    assert [exchange.differ("a") for _ in range(3)] == [1, 1, 1]
    exchange.ask(TIMING.retry_after)
    assert exchange.differ("a") == 2


@pytest.mark.parametrize("doubtful", [False, True])
def test_what_a_timesync_may_have_overtaken_is_waited_for_where_there_is_doubt(doubtful):
    fence = Fence(0.0, TIMING)
    fence.up(0.0)
    assert not fence.passed(0.0, doubtful=True)
    (ping,) = fence.ask(0.0)
    fence.hear(Pong(ping.token, 9.0), 0.2)
    assert fence.passed(0.2, doubtful=doubtful) is not doubtful
    assert fence.passed(0.31, doubtful=doubtful)


def test_a_timesync_sent_before_the_fence_proves_nothing():
    fence = Fence(0.0, TIMING)
    (ping,) = fence.ask(0.0)
    fence.up(0.1)
    fence.hear(Pong(ping.token, 9.0), 0.2)
    assert not fence.passed(5.0, doubtful=False)
