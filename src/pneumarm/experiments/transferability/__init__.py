"""What is left of each agent on the arm (sections 3.4, 5.4.1, 5.4.2, 5.4.4)?

The thesis expects that switches make an agent hard to transfer, asks what is left of agents that learned without
shaping, and adds noise to the simulation for the sake of the transfer; it transferred one agent only. Here agents
of every kind begin with the same weights, the best of eight by its own validation comes to the arm as it is in the
morning, and all are judged by the same reward, in the simulation with the thesis' noise and on the arm: greedy and
without learning.

    pneumarm experiment transferability

Answer here, on five arms: trial 10 loses 3 ± 3 of its reward on the way to the arm, and no other kind of agent surely
loses more or less. They differ in what they earn in either place: without shaping 12 less on the arm, and without the
punishment a third of the movements fail, so that no more is lost by the transfer.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from pneumarm.experiments.differences import above, within
from pneumarm.experiments.evidence import difference, mean, number, over_arms, plain, table, thesis, values
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
from pneumarm.learning import Exploration, TrainSettings
from pneumarm.report.page import Section
from pneumarm.simulation.noise import NoiseSettings
from pneumarm.task import Reward

BASE, NO_SHAPING, NO_PUNISHMENT, NO_NOISE, WHITE, TWICE = range(1, 7)
KINDS: Mapping[int, tuple[str, dict[str, Any]]] = {
    BASE: ("trial 10 of table 5.3", {}),
    NO_SHAPING: ("without shaping", {"shaping": None, "exploration": Exploration(0.09, 10.0)}),
    NO_PUNISHMENT: ("switches not punished", {"reward": Reward(switch=0.0)}),
    NO_NOISE: ("without noise", {"noise": NoiseSettings(kind="none")}),
    WHITE: ("white noise", {"noise": NoiseSettings(kind="white")}),
    TWICE: ("twice the noise", {"noise": NoiseSettings(factor=2.0)}),
}
"""Kinds of agents by trial: in words, and what is changed in the settings of their training."""
_MARGIN = 3.0  # reward that is marginal


@dataclass(frozen=True)
class Transferability(AgentsByTrial):
    """Agents that learned in different ways, in the simulation and on the arm."""

    name: str = "transferability"
    title: str = "Transferability"
    question: str = "How much of what an agent earns in the simulation is left on the arm, by how it learned?"
    source: str = "Thesis sections 3.4, 5.4.1, 5.4.2 and 5.4.4"

    @property
    def trials(self) -> Mapping[int, str]:
        """How the agents learned."""
        return {trial: words for trial, (words, _) in KINDS.items()}

    def train_settings(self, trial: int) -> TrainSettings:
        """Return how the agents of ``trial`` learn."""
        return replace(self.agent, **KINDS[trial][1])

    def measure(self, material: Material, trial: int, run: int, settings: LaboratorySettings) -> Figures:
        """Train, and move in the simulation and on the arm."""
        found = agent_of(material, self.train_settings(trial), run, settings)
        judged = replace(found, settings=replace(found.settings, reward=Reward()))  # all by the same reward
        before = simulated_test(material, judged, settings.test_episodes, noise=NoiseSettings(), prefix=SIMULATION)
        played = greedy_test(material, judged, self.sizes.test, run, settings)
        return {**before, **means(played)}

    def analyse(self, rows: Rows) -> Analysis:
        """Return what every kind of agent earns, and what it loses on the arm."""
        names = list(self.trials.values())
        lost = {trial: values(rows, SIMULATION + "reward", trial) - values(rows, "reward", trial) for trial in KINDS}
        shown = {
            "reward on the arm [-]": [mean(rows, "reward", trial) for trial in KINDS],
            "lost on the way [-]": [over_arms(lost[trial]) for trial in KINDS],
            "switches of successes\non the arm [-]": [mean(rows, "switches", trial) for trial in KINDS],
        }
        columns = [*in_both("reward"), *in_both("success_rate", " [%]", 1, 100.0), *in_both("switches")]
        said = thesis(__name__)
        unpunished, unshaped = (over_arms(lost[t] - lost[BASE]) for t in (NO_PUNISHMENT, NO_SHAPING))
        noiseless, louder = (difference(rows, "reward", BASE, NO_NOISE), difference(rows, "reward", TWICE, BASE))
        return Analysis(
            summary=[
                self.question,
                "Of their reward agents lose on the way to the arm: "
                + "; ".join(f"{words}: {plain(over_arms(lost[trial]), 1)}" for trial, words in self.trials.items())
                + ". Intervals are over arms, each the mean of its runs.",
            ],
            figures={
                "lost": {words: number(over_arms(lost[trial])) for trial, words in self.trials.items()},
                "reward": self.by_trial(rows, "reward"),
            },
            sections=[
                Section(
                    "Agents by how they learned",
                    ["All are judged by the thesis' reward: 50 at the goal, -1 an action, -8 a switch."],
                    tables=[table(rows, self.trials, columns, "Means over arms; switches of successful movements.")],
                    figures=[
                        dots(
                            names,
                            shown,
                            "What agents earn on the arm, what they lose on the way there, how often they switch.",
                        )
                    ],
                )
            ],
            claims=[
                Claim(
                    "Agents that are not punished for switches lose more on the way to the arm",
                    said["punishment"],
                    f"lost more: {plain(unpunished)}",
                    above(unpunished),
                    "punishment-transfer",
                ),
                Claim(
                    "Agents that learned without shaping lose more on the way to the arm",
                    said["shaping"],
                    f"lost more: {plain(unshaped)}",
                    above(unshaped),
                    "shaping-transfer",
                ),
                Claim(
                    "Noise in the simulation raises the reward on the arm",
                    said["noise"],
                    f"by {plain(noiseless)}",
                    above(noiseless),
                    "noise",
                ),
                Claim(
                    f"Twice the noise changes the reward on the arm by less than {_MARGIN:g}",
                    said["more_noise"],
                    f"by {plain(louder)}",
                    within(louder, _MARGIN),
                    "noise",
                ),
            ],
        )


EXPERIMENT = Transferability()
