"""Letting time pass on a virtual arm: exactly, or a little late as under an operating system."""

import math

from pneumarm.arm.virtual.rest import CALM_SAMPLES, CALM_SPEED, LAST, LONG, SAMPLE, fast_forward, fastest, steady
from pneumarm.arm.virtual.step import SUBSTEP, integrate
from pneumarm.kernels import borrowed, inner, kernel
from pneumarm.random import uniform

MOST_LATENESS = 8.0
"""The control cycle is never later than so many standard deviations."""


@kernel
def pass_time(body, until):  # type: ignore[no-untyped-def]
    """Let time pass until the clock shows ``until`` [s], by fast-forward where the arm rests."""
    body = borrowed(body)
    surroundings = body.surroundings[0]
    calm = 0
    while until - surroundings.time > LONG:
        if calm >= CALM_SAMPLES and steady(body):
            calm = CALM_SAMPLES if fast_forward(body, until - LAST) else 0
        integrate(body, min(until, surroundings.time + SAMPLE), SUBSTEP)
        calm = calm + 1 if fastest(body) < CALM_SPEED else 0
    integrate(body, until, SUBSTEP)


@inner
def pass_for(body, seconds):  # type: ignore[no-untyped-def]
    """Let ``seconds`` [s] pass."""
    pass_time(body, body.surroundings[0].time + seconds)


@kernel
def drawn_lateness(body):  # type: ignore[no-untyped-def]
    """Return how long the operating system takes to wake up [s]."""
    return min(-body.lateness * math.log(1.0 - uniform(body.jitter_random)), MOST_LATENESS * body.lateness)


@inner
def pass_until(body, time):  # type: ignore[no-untyped-def]
    """Let time pass until ``time`` [s] and then as long as the operating system takes to wake up."""
    if time > body.surroundings[0].time:
        pass_time(body, time + drawn_lateness(body))
