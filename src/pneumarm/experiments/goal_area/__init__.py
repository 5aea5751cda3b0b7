"""What precision costs (section 5.1): goals of 25 and 12 counts, and speeds at the goal of 1 and 0.5 counts/ms.

The thesis takes 25 counts and 1 count/ms (eq. 5.1, 5.2), "partly by empirical observations", and supposes that 0.5
may be possible. Agents learn each goal area by themselves and are tested with it, in the simulation and on the arm
as it is in the morning: greedy and without learning, the same begin states and goals.

    pneumarm experiment goal-area

Answer here, on five arms: 96 % of the movements succeed with the thesis' goal area. Half the speed or half the angle
costs some 20 of reward each, and 6 points of success; both cost twice as much. Fewer than half of the movements end
at less than half the speed that is allowed.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from pneumarm.experiments.differences import above, below
from pneumarm.experiments.evidence import Column, difference, mean, number, plain, table, thesis
from pneumarm.experiments.experiment import Analysis, Claim, Figures, LaboratorySettings, Rows
from pneumarm.experiments.moving import (
    SIMULATION,
    AgentsByTrial,
    Material,
    agent_of,
    greedy_test,
    in_both,
    means,
    simulated_test,
)
from pneumarm.experiments.pictures import dots
from pneumarm.learning import TrainSettings
from pneumarm.report.page import Section
from pneumarm.task import Reward

AREAS = {1: (25.0, 1.0), 2: (25.0, 0.5), 3: (12.0, 1.0), 4: (12.0, 0.5)}
"""Tolerances of angle [counts] and velocity [counts/ms] by trial."""
_NEAR_ALL = 0.97
_AS_GOOD = 0.03  # success that may be lost


@dataclass(frozen=True)
class GoalArea(AgentsByTrial):
    """Four goal areas, each learned and tested."""

    name: str = "goal-area"
    title: str = "The goal area"
    question: str = "What does a smaller goal area cost, in the simulation and on the arm?"
    source: str = "Thesis section 5.1, eq. 5.1 and 5.2"

    @property
    def trials(self) -> Mapping[int, str]:
        """Goal areas."""
        return {t: f"{angle:g} counts, {velocity:g} counts/ms" for t, (angle, velocity) in AREAS.items()}

    def train_settings(self, trial: int) -> TrainSettings:
        """Return how the agents of ``trial`` learn."""
        angle, velocity = AREAS[trial]
        return replace(self.agent, reward=Reward(angle_tolerance=angle, velocity_tolerance=velocity))

    def measure(self, material: Material, trial: int, run: int, settings: LaboratorySettings) -> Figures:
        """Train, and move in the simulation and on the arm."""
        agent = agent_of(material, self.train_settings(trial), run, settings)
        before = simulated_test(material, agent, settings.test_episodes, prefix=SIMULATION)
        made = greedy_test(material, agent, self.sizes.test, run, settings)
        speed = np.abs(made.velocity_end).max(axis=1)[made.success]
        slow = {"half as fast at the end": float((speed <= AREAS[trial][1] / 2).mean())} if made.success.any() else {}
        return {**before, **means(made), **slow}

    def analyse(self, rows: Rows) -> Analysis:
        """Return what each goal area costs."""
        names, base = list(self.trials.values()), 1
        shown = {
            "success on the arm [%]": [Column("success_rate", "", factor=100.0).interval(rows, t) for t in AREAS],
            "actions of successes\non the arm [-]": [mean(rows, "actions", t) for t in AREAS],
            "reward on the arm [-]": [mean(rows, "reward", t) for t in AREAS],
        }
        columns = [
            *in_both("reward"),
            *in_both("success_rate", " [%]", 1, 100.0),
            *in_both("actions"),
            Column("switches", "switches, arm"),
            Column("half as fast at the end", "end at half the speed allowed [%]", 1, 100.0),
        ]
        said = thesis(__name__)
        slow, half_speed = mean(rows, "half as fast at the end", base), difference(rows, "success_rate", 2, base)
        costs = {t: difference(rows, "reward", t, base) for t in AREAS if t != base}
        return Analysis(
            summary=[
                self.question,
                f"On the arm half the speed costs {plain(costs[2], factor=-1)} of the reward, half the angle "
                f"{plain(costs[3], factor=-1)}, and both {plain(costs[4], factor=-1)}. Intervals are over arms, each "
                "the mean of its runs.",
            ],
            figures={
                "reward": self.by_trial(rows, "reward"),
                "success_rate": self.by_trial(rows, "success_rate"),
                "cost": {self.trials[t]: number(found) for t, found in costs.items()},
            },
            sections=[
                Section(
                    "Goal areas",
                    ["Actions and switches are those of successful movements."],
                    tables=[table(rows, self.trials, columns, "Means over arms with 95 % intervals.")],
                    figures=[dots(names, shown, "Success, actions and reward on the arm by goal area.")],
                )
            ],
            claims=[
                Claim(
                    "With 25 counts and 1 count/ms movements succeed on the arm (97 % and more)",
                    said["suits"],
                    f"{plain(mean(rows, 'success_rate', base), 1, 100)} %",
                    above(mean(rows, "success_rate", base), _NEAR_ALL),
                    "goal-area",
                ),
                Claim(
                    "Movements end slower than they need: most at less than half the speed allowed",
                    said["slow"],
                    f"{plain(slow, 1, 100)} %",
                    above(slow, 0.5),
                    "goal-area",
                ),
                Claim(
                    f"Half the speed at the goal is possible: {100 * _AS_GOOD:g} points of success less at most",
                    said["pushed"],
                    f"{plain(half_speed, 1, 100)} points",
                    above(half_speed, -_AS_GOOD),
                    "goal-area",
                ),
                Claim(
                    "Half the angle costs reward on the arm",
                    said["smaller"],
                    f"reward {plain(costs[3])}",
                    below(costs[3]),
                    "goal-area",
                ),
            ],
        )


EXPERIMENT = GoalArea()
