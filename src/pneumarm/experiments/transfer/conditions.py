"""Agents that learn on the arm at three rates, and conditions of the arm that take the drop on arrival apart."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

from pneumarm.arm.virtual import ArmParameters
from pneumarm.arm.virtual.parameters import without_noise
from pneumarm.control.turns import player
from pneumarm.experiments.experiment import Figures, LaboratorySettings, run_seed
from pneumarm.experiments.moving import (
    MOVEMENTS,
    SIMULATION,
    TEST_MOVEMENTS,
    OnTheArm,
    agent_of,
    clock,
    course,
    draws,
    from_visits,
    greedy_test,
    means,
    new_arm,
    parameters_of,
    simulated_test,
)
from pneumarm.experiments.preparation import Simulated
from pneumarm.experiments.words import words_of
from pneumarm.simulation.noise import NoiseSettings

RATES = {1: 0.0, 2: 0.05, 3: 0.10}
"""Learning rates on the arm by trial."""
AS_IT_IS, NO_NOISE, PUNCTUAL, WARM, ALL = range(4, 9)
CONDITIONS = {
    AS_IT_IS: "the arm as it is in the morning",
    NO_NOISE: "sensors without noise",
    PUNCTUAL: "control never late",
    WARM: "arm that has moved for an hour",
    ALL: "all three",
}
IDEAL = (NO_NOISE, PUNCTUAL, ALL)
"""Conditions that only an arm of known physics can be put into: a virtual one."""
EXPLORING = "simulation, exploring: "
FROM_ARM, WITHOUT_NOISE = "simulation from the arm's begin states: ", "the same without noise: "
"""Prefixes of the figures of tests in the simulation."""


@dataclass(frozen=True)
class TransferSizes:
    """How much is moved in a row."""

    learning: int = 2000
    """Movements of trials 1 to 3."""
    block: int = 100
    """Movements in a point of the courses; the first of them is the arrival."""
    test: int = 300
    """Movements of trials 4 to 8."""
    warming: int = 800
    """Movements that warm the arm, about an hour."""


@dataclass(frozen=True)
class TransferToTheArm(OnTheArm):
    """The three agents of section 5.5.1, and the causes of the drop."""

    name = "transfer"
    words = words_of(__package__)
    sizes: TransferSizes = TransferSizes()

    @property
    def trials(self) -> Mapping[int, str]:
        """Learning rates, then conditions of the arm."""
        return {trial: f"learning rate {rate:.2f}" for trial, rate in RATES.items()} | CONDITIONS

    def measure(self, material: Simulated, trial: int, run: int, settings: LaboratorySettings) -> Figures:
        """Move on the arm, learning or under a condition."""
        if trial in RATES:
            return self._learning(material, RATES[trial], run, settings)
        return self._condition(material, trial, run, settings)

    def movements(self, trial: int, arm: str, settings: LaboratorySettings) -> int:
        """Return those while learning, or of warming and tests."""
        if trial in RATES:
            return self.sizes.learning
        if trial in IDEAL and not arm.startswith("virtual"):
            return 0
        warming = self.sizes.warming if trial in (WARM, ALL) else 0
        return warming + self.sizes.test * (2 if trial == AS_IT_IS else 1)

    def _learning(self, of: Simulated, rate: float, run: int, laboratory: LaboratorySettings) -> Figures:
        agent, seed = agent_of(of, self.agent, run, laboratory), run_seed(laboratory, run)
        explores = self.agent.exploration
        with new_arm(of, run, laboratory) as arm:
            began, learner = clock(arm), player(agent, arm, rate, explores, seed)
            played = learner.play(*draws(agent, seed, self.sizes.learning, MOVEMENTS))
        return {
            **simulated_test(of, agent, laboratory.test_episodes, exploration=explores, prefix=EXPLORING),
            **course(played, self.sizes.block),
            "hours": float((played.time_end[-1] - began) / 3600),
        }

    def _condition(self, of: Simulated, trial: int, run: int, laboratory: LaboratorySettings) -> Figures:
        parameters = parameters_of(of.arm)
        if trial in IDEAL and parameters is None:
            return {}
        agent, seed = agent_of(of, self.agent, run, laboratory), run_seed(laboratory, run)
        with new_arm(of, run, laboratory, parameters and changed(parameters, trial)) as arm:
            if trial in (WARM, ALL):
                player(agent, arm).play(*draws(agent, seed, self.sizes.warming, MOVEMENTS))
            found = means(greedy_test(of, agent, self.sizes.test, run, laboratory, arm))
        if trial != AS_IT_IS:
            return found
        # What is simulated does not depend on the trial.
        count = laboratory.test_episodes
        _, durations = draws(agent, seed, self.sizes.test, TEST_MOVEMENTS)
        with new_arm(of, run, laboratory) as arm:
            begin = from_visits(agent, *player(agent, arm).visit(durations))
        there = replace(of, begin=begin)
        quiet = NoiseSettings(kind="none")
        return {
            **found,
            **simulated_test(of, agent, count, prefix=SIMULATION),
            **simulated_test(there, agent, count, prefix=FROM_ARM),
            **simulated_test(there, agent, count, noise=quiet, prefix=WITHOUT_NOISE),
        }


def changed(parameters: ArmParameters, trial: int) -> ArmParameters:
    """Return the arm under the condition of ``trial``."""
    ideal = without_noise(parameters)
    if trial == NO_NOISE:
        return replace(parameters, sensors=ideal.sensors)
    if trial == PUNCTUAL:
        return replace(parameters, jitter=ideal.jitter)
    return ideal if trial == ALL else parameters
