"""The testing phase of section 5.2 for whatever acts step by step, compiled or not."""

from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pneumarm.errors import UnusableInput
from pneumarm.kernels import kernel
from pneumarm.random import random_state
from pneumarm.task.environment import Environment, Episode, begin_episode, episode, take, take_pulses
from pneumarm.task.movements import NOISE, Movements, movements
from pneumarm.task.noting import goes_on, note_action, note_begin, note_end

LATE = 1.5
"""Periods from one turn to the next from which on that is late: what was decided took too long, or came too late."""


class Acting(Protocol):
    """What acts step by step."""

    def begin(self, state: ArrayLike, goal: ArrayLike) -> None:
        """Begin an episode at rest in the scaled ``state`` (state_size,) towards ``goal`` (joints,) [counts]."""

    def act(self) -> NDArray[np.int64] | NDArray[np.float64]:
        """Return the actions (joints,) of the current state, or pulses (joints, 2)."""

    def follow(self, next_state: ArrayLike) -> None:
        """Go on in ``next_state`` without learning."""


@runtime_checkable
class Hurries(Protocol):
    """What can decide faster, and less well."""

    def hurry(self) -> None:
        """Take about half as long from now on: turns come late, and a command that comes late is not given."""


@kernel
def _begin(environment, episode, random, record, e):  # type: ignore[no-untyped-def]
    begin_episode(environment, episode, np.inf, random)
    note_begin(environment.task, episode, record, e)


@kernel
def _take_pulses(environment, episode, pulses, record, e):  # type: ignore[no-untyped-def]
    """Do what :func:`_take` does with ``pulses`` (joints, 2)."""
    is_reached = take_pulses(environment, episode, pulses)
    note_action(environment.task.reward, episode.switched, is_reached, record, e)
    note_end(environment.task, episode, is_reached, record, e)
    return goes_on(environment.task, is_reached, record, e)


@kernel
def _take(environment, episode, actions, record, e):  # type: ignore[no-untyped-def]
    """Take ``actions`` (joints,) in movement ``e``; return whether it goes on."""
    is_reached = take(environment, episode, actions)
    note_action(environment.task.reward, episode.switched, is_reached, record, e)
    note_end(environment.task, episode, is_reached, record, e)
    return goes_on(environment.task, is_reached, record, e)


def _next(env: Environment, one: Episode, said: NDArray[Any], record: Movements, e: int) -> bool:
    return bool((_take if said.ndim == 1 else _take_pulses)(env, one, said, record, e))


def test_acting(actor: Acting, env: Environment, episodes: int, seed: tuple[int, ...]) -> Movements:
    """Return movements of ``actor`` in ``env`` with the begin states and goals that any agent gets by ``seed``.

    Raises:
        UnusableInput: there is no episode.

    """
    if episodes < 1:
        raise UnusableInput(f"a test needs at least one episode, got {episodes}")
    one, random = episode(env, random_state((*seed, NOISE))), random_state(seed)
    record = movements(episodes, one.goal.size)
    size = env.begin.states.shape[1]
    for e in range(episodes):
        _begin(env, one, random, record, e)
        actor.begin(one.state.x[:size], one.goal)
        while _next(env, one, actor.act(), record, e):
            actor.follow(one.state.x[:size])
    return record


test_acting.__test__ = False  # type: ignore[attr-defined]
