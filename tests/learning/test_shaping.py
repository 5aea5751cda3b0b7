"""The shaping strategy of section 4.3.2."""

import math

import pytest

from pneumarm.arm import ArmSpec
from pneumarm.errors import UnusableInput
from pneumarm.learning import Exploration, Shaping, TrainSettings
from pneumarm.learning.online.shaping import adjusted, initial_deviation, stage
from pneumarm.task import Reward

SPEC, SETTINGS = ArmSpec(), TrainSettings()


def test_defaults_are_the_thesis() -> None:
    assert (SETTINGS.method, SETTINGS.learning_rate, SETTINGS.hidden) == ("sarsa", 0.05, 5)
    assert (SETTINGS.trace_decay, SETTINGS.discount, SETTINGS.cutoff) == (0, 0.98, 100)
    assert (Reward().goal, Reward().action, Reward().switch) == (50, -1, -8)


def test_stages_are_linear_in_the_deviation() -> None:
    first, last = initial_deviation(SETTINGS, SPEC), 1023.0
    for deviation, expected in [
        (first, (0.5, 0.5, 20.0)),
        (last, (0.95, 0.05, 1.0)),
        ((first + last) / 2, (0.725, 0.275, 10.5)),
    ]:
        now = stage(deviation, SETTINGS, SPEC)
        assert (now.criterion, now.schedule.epsilon, now.schedule.temperature) == pytest.approx(expected)
        assert now.schedule.deviation == deviation
        assert now.whole == (deviation == last)


def test_deviation_follows_the_performance() -> None:
    d = 200.0
    demanded = stage(d, SETTINGS, SPEC).criterion
    assert adjusted(d, demanded + 1e-9, SETTINGS, SPEC) == pytest.approx(220)
    assert adjusted(d, demanded, SETTINGS, SPEC) == pytest.approx(194)  # it has to exceed the criterion
    assert adjusted(1000.0, 1.0, SETTINGS, SPEC) == 1023
    first = initial_deviation(SETTINGS, SPEC)
    assert adjusted(first, 0.0, SETTINGS, SPEC) == first


def test_a_perfect_agent_needs_at_least_the_fifteen_thousand_episodes_of_the_thesis() -> None:
    deviation, rounds = initial_deviation(SETTINGS, SPEC), 0
    while not stage(deviation, SETTINGS, SPEC).whole:
        deviation, rounds = adjusted(deviation, 1.0, SETTINGS, SPEC), rounds + 1
    assert 15_000 <= 500 * rounds <= 16_000
    assert rounds == math.ceil(math.log(1023 / (5 * SPEC.counts_per_degree)) / math.log(1.1))


def test_without_shaping_everything_is_as_at_the_end() -> None:
    settings = TrainSettings(shaping=None)
    now = stage(initial_deviation(settings, SPEC), settings, SPEC)
    assert now.whole
    assert math.isinf(now.schedule.deviation)
    assert (now.criterion, now.schedule.epsilon, now.schedule.temperature) == (0.95, 0.05, 1.0)
    assert adjusted(1023.0, 0.0, settings, SPEC) == 1023.0


@pytest.mark.parametrize(
    ("kind", "wrong"),
    [
        (TrainSettings, {"method": "dqn"}),
        (TrainSettings, {"learning_rate": math.nan}),
        (TrainSettings, {"hidden": 0}),
        (TrainSettings, {"discount": 1.1}),
        (TrainSettings, {"agents": 0}),
        (Shaping, {"shrink": 1.0}),
        (Shaping, {"weights": ()}),
        (Reward, {"goal": math.inf}),
        (Exploration, {"temperature": 0.0}),
    ],
)
def test_unusable_settings(kind: type, wrong: dict) -> None:
    with pytest.raises(UnusableInput, match=next(iter(wrong))):
        kind(**wrong)


def test_reward_for_people_is_that_of_the_kernels() -> None:
    reward = Reward()
    assert reward.reached([510, 480], [1.0, -1.0], [485, 505])
    assert not reward.reached([510, 480], [1.0, -1.0], [484.9, 505])
    assert not reward.reached([500], [1.01], [500])
    assert reward.of(True, [False, True]).tolist() == [50, 42]
    assert reward.of(False, [1]).tolist() == [-9]
