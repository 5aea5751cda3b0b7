"""Each policy against its distribution (section 4.2.2)."""

import numpy as np
import pytest
from scipy.stats import chisquare

from pneumarm.arm.valves import NEVER
from pneumarm.kernels import kernel
from pneumarm.learning.values.policies import POLICIES, PolicyName, act_by, boltzmann
from pneumarm.random import random_state

DRAWS = 100_000
VALUES = np.array([3, -20, 10, 9.5, 0, 2, 8, -50, 7], np.float32)


@kernel
def _count(policy, values, epsilon, temperature, random, counts, draws):  # type: ignore[no-untyped-def]
    odds = np.zeros(values.shape[0], np.float32)
    for _ in range(draws):
        counts[act_by(policy, values, epsilon, temperature, odds, random)] += 1


def counted(policy: PolicyName, values: np.ndarray, epsilon: float, temperature: float) -> np.ndarray:
    counts = np.zeros(len(values))
    _count(POLICIES.index(policy), values, epsilon, temperature, random_state(2), counts, DRAWS)
    return counts


def expected(policy: PolicyName, values: np.ndarray, epsilon: float, temperature: float) -> np.ndarray:
    odds = np.exp(values.astype(float) / temperature)
    best, each = np.eye(len(values))[values.argmax()], np.full(len(values), 1 / len(values))
    others = odds * (1 - best)
    return {
        "greedy": best,
        "epsilon-greedy": (1 - epsilon) * best + epsilon * each,
        "boltzmann": odds / odds.sum(),
        "max-boltzmann": (1 - epsilon) * best + epsilon * others / others.sum(),
    }[policy]


@pytest.mark.parametrize("policy", POLICIES)
@pytest.mark.parametrize(("epsilon", "temperature"), [(0.5, 20.0), (0.05, 2.0), (1.0, 5.0)])
def test_actions_are_taken_as_often_as_they_should(policy: PolicyName, epsilon: float, temperature: float) -> None:
    got, odds = counted(policy, VALUES, epsilon, temperature), expected(policy, VALUES, epsilon, temperature)
    is_common = DRAWS * odds >= 5
    assert got[~is_common].sum() <= 30
    if is_common.sum() == 1:
        assert got[is_common] == DRAWS
    else:
        assert chisquare(got[is_common], odds[is_common] / odds[is_common].sum() * got[is_common].sum()).pvalue > 1e-4


def test_boltzmann_is_equation_4_8() -> None:
    odds = np.zeros(9, np.float32)
    boltzmann(VALUES, 4.0, odds)
    np.testing.assert_allclose(odds, expected("boltzmann", VALUES, 0.0, 4.0), rtol=1e-5)
    boltzmann(VALUES * np.float32(1e6), 1e-3, odds)  # overflows nowhere
    assert odds[2] == 1 == odds.sum()


@pytest.mark.parametrize("policy", POLICIES)
def test_what_an_arm_cannot_do_is_never_done(policy: PolicyName) -> None:
    values = np.where(np.arange(9) % 3 == 1, VALUES, np.float32(NEVER)).astype(np.float32)
    got = counted(policy, values, 1.0, 1e4)
    assert got[np.arange(9) % 3 != 1].sum() == 0
    assert got.sum() == DRAWS
