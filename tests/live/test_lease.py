"""Who controls an arm: one page at a time, and never one that is silent."""

import math

import pytest

from pneumarm.live.lease import HOLD_AFTER, VENT_AFTER, ControlLease


@pytest.fixture
def now() -> list[float]:
    return [100.0]


@pytest.fixture
def lease(now: list[float]) -> ControlLease:
    return ControlLease(lambda: now[0])


def test_the_first_to_take_control_has_it_and_hands_it_over(lease: ControlLease) -> None:
    first, second, third = lease.enter(), lease.enter(), lease.enter()
    assert lease.take(first)
    assert not lease.take(second)
    assert not lease.take(third)
    assert (lease.writer, lease.asking) == (first, second)
    lease.hand_over(third)
    assert lease.writer == first
    lease.hand_over(first)
    assert (lease.writer, lease.asking) == (second, None)


def test_who_is_silent_loses_control_to_who_takes_it(lease: ControlLease, now: list[float]) -> None:
    first, second = lease.enter(), lease.enter()
    lease.take(first)
    now[0] += HOLD_AFTER / 2
    lease.hear(second)  # a watcher is not who is waited for
    assert lease.silence == HOLD_AFTER / 2
    lease.hear(first)
    assert lease.silence == 0
    now[0] += HOLD_AFTER
    assert lease.take(second)
    assert (lease.writer, lease.silence) == (second, 0)


def test_a_page_that_is_gone_counts_as_silent_at_once(lease: ControlLease, now: list[float]) -> None:
    assert lease.silence == math.inf
    page = lease.enter()
    lease.take(page)
    lease.leave(page)
    assert (lease.writer, lease.pages) == (None, [])
    assert HOLD_AFTER <= lease.silence < VENT_AFTER
    now[0] += VENT_AFTER
    assert lease.silence >= VENT_AFTER


def test_a_page_that_asked_and_is_gone_gets_nothing(lease: ControlLease) -> None:
    first, second = lease.enter(), lease.enter()
    lease.take(first)
    lease.take(second)
    lease.leave(second)
    lease.hand_over(first)
    assert (lease.writer, lease.asking) == (None, None)
