"""Who controls an arm: one page at a time, and never one that is silent."""

import math

import pytest

from pneumarm.live.desk import HOLD_AFTER, VENT_AFTER, Desk


@pytest.fixture
def now() -> list[float]:
    return [100.0]


@pytest.fixture
def desk(now: list[float]) -> Desk:
    return Desk(lambda: now[0])


def test_the_first_to_take_control_has_it_and_hands_it_over(desk: Desk) -> None:
    first, second, third = desk.enter(), desk.enter(), desk.enter()
    assert desk.take(first)
    assert not desk.take(second)
    assert not desk.take(third)
    assert (desk.writer, desk.asking) == (first, second)
    desk.hand_over(third)
    assert desk.writer == first
    desk.hand_over(first)
    assert (desk.writer, desk.asking) == (second, None)


def test_who_is_silent_loses_control_to_who_takes_it(desk: Desk, now: list[float]) -> None:
    first, second = desk.enter(), desk.enter()
    desk.take(first)
    now[0] += HOLD_AFTER / 2
    desk.hear(second)  # a watcher is not who is waited for
    assert desk.silence == HOLD_AFTER / 2
    desk.hear(first)
    assert desk.silence == 0
    now[0] += HOLD_AFTER
    assert desk.take(second)
    assert (desk.writer, desk.silence) == (second, 0)


def test_a_page_that_is_gone_counts_as_silent_at_once(desk: Desk, now: list[float]) -> None:
    assert desk.silence == math.inf
    page = desk.enter()
    desk.take(page)
    desk.leave(page)
    assert (desk.writer, desk.pages) == (None, [])
    assert HOLD_AFTER <= desk.silence < VENT_AFTER
    now[0] += VENT_AFTER
    assert desk.silence >= VENT_AFTER


def test_a_page_that_asked_and_is_gone_gets_nothing(desk: Desk) -> None:
    first, second = desk.enter(), desk.enter()
    desk.take(first)
    desk.take(second)
    desk.leave(second)
    desk.hand_over(first)
    assert (desk.writer, desk.asking) == (None, None)
