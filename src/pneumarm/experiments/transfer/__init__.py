"""From the simulation to the arm (section 5.5.1): what is lost on arrival, through what, and who gets it back?

The agent of trial 10, the best of eight of its run, comes to the arm in the morning after a night of rest. Trials 1
to 3 are the thesis' three agents: they explore as at the end of their training and learn with 0, 0.05 and 0.10.
Trials 4 to 8 take the drop apart: the same agent, greedy and without learning, makes the same movements on the arm
as it is, on one whose sensors have no noise, on one that is never late, on one that has moved for an hour, and on one
with all three; what still differs from the simulation is the error of the model. The thesis could not tell these
apart.

    pneumarm experiment transfer

On arms 1 to 5, four runs each, the agent that does not learn loses 0.4 ± 3.5 of its reward on arrival, where the
thesis lost more than 15. Of the causes only the error of the model surely takes something, 3.6 ± 2.1 of a greedy
agent's reward. Learning on the arm does not help: with 0.10 agents end 22 ± 9 below the one that does not learn, with
0.05 by 8 ± 11.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pneumarm.arm.virtual import ArmParameters
from pneumarm.arm.virtual.parameters import without_noise
from pneumarm.control.playing import Player
from pneumarm.experiments.differences import Interval, above
from pneumarm.experiments.evidence import (
    Column,
    blocks,
    difference,
    mean,
    number,
    over_arms,
    plain,
    signed,
    table,
    thesis,
    values,
)
from pneumarm.experiments.experiment import Analysis, Claim, Figures, LaboratorySettings, Rows, run_seed
from pneumarm.experiments.moving import (
    MOVEMENTS,
    SIMULATION,
    TEST_MOVEMENTS,
    Material,
    OnTheArm,
    agent_of,
    course,
    draws,
    from_visits,
    greedy_test,
    means,
    new_arm,
    simulated_test,
)
from pneumarm.experiments.pictures import Curve, courses, dots
from pneumarm.report.page import Section
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
_EXPLORING = "simulation, exploring: "
_FROM_ARM, _WITHOUT_NOISE = "simulation from the arm's begin states: ", "the same without noise: "
_ALL_THREE = "noise, lateness and cold together"
_MODEL, _COLD, _DROP = "error of the model", "cold arm", "drop-causes"
_NEAR_ALL = 0.97  # "nearly 100 %" in numbers


@dataclass(frozen=True)
class Sizes:
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
class Transfer(OnTheArm):
    """The three agents of section 5.5.1, and the causes of the drop."""

    name: str = "transfer"
    title: str = "Transfer to the arm"
    question: str = (
        "What does an agent lose on its way from the simulation to the arm, why, and does learning bring it back?"
    )
    source: str = "Thesis section 5.5.1, figures 5.9 to 5.12"
    sizes: Sizes = Sizes()

    @property
    def trials(self) -> Mapping[int, str]:
        """Learning rates, then conditions of the arm."""
        return {trial: f"learning rate {rate:.2f}" for trial, rate in RATES.items()} | CONDITIONS

    def measure(self, material: Material, trial: int, run: int, settings: LaboratorySettings) -> Figures:
        """Move on the arm, learning or under a condition."""
        if trial in RATES:
            return self._learning(material, RATES[trial], run, settings)
        return self._condition(material, trial, run, settings)

    def _learning(self, of: Material, rate: float, run: int, laboratory: LaboratorySettings) -> Figures:
        agent, seed = agent_of(of, self.agent, run, laboratory), run_seed(laboratory, run)
        explores = self.agent.exploration
        player = Player(agent, new_arm(of, run, laboratory), rate, explores, seed)
        played = player.play(*draws(agent, seed, self.sizes.learning, MOVEMENTS))
        return {
            **simulated_test(of, agent, laboratory.test_episodes, exploration=explores, prefix=_EXPLORING),
            **course(played, self.sizes.block),
            "hours": float(played.time_end[-1] / 3600),
        }

    def _condition(self, of: Material, trial: int, run: int, laboratory: LaboratorySettings) -> Figures:
        agent, seed = agent_of(of, self.agent, run, laboratory), run_seed(laboratory, run)
        arm = new_arm(of, run, laboratory, changed(of.parameters, trial))
        if trial in (WARM, ALL):
            Player(agent, arm).play(*draws(agent, seed, self.sizes.warming, MOVEMENTS))
        found = means(greedy_test(of, agent, self.sizes.test, run, laboratory, arm))
        if trial != AS_IT_IS:
            return found
        # What is simulated does not depend on the trial.
        count = laboratory.test_episodes
        _, durations = draws(agent, seed, self.sizes.test, TEST_MOVEMENTS)
        begin = from_visits(agent, *Player(agent, new_arm(of, run, laboratory)).visit(durations))
        there = replace(of, simulated=replace(of.simulated, begin=begin))
        quiet = NoiseSettings(kind="none")
        return {
            **found,
            **simulated_test(of, agent, count, prefix=SIMULATION),
            **simulated_test(there, agent, count, prefix=_FROM_ARM),
            **simulated_test(there, agent, count, noise=quiet, prefix=_WITHOUT_NOISE),
        }

    def analyse(self, rows: Rows) -> Analysis:
        """Return the courses beside the thesis', the causes, and what holds of section 5.5.1."""
        causes = _causes(rows)
        claims = [*self._claims(rows), *_claims_on_causes(causes)]
        drop = over_arms(_arrival(rows, 1, "reward"))
        single = {name: found for name, found in causes.items() if name != _ALL_THREE}
        largest = max(single, key=lambda name: single[name].mean)
        learned = ", ".join(
            f"{signed(_better(rows, trial))} with {RATES[trial]:g}" for trial in RATES if RATES[trial]
        )
        return Analysis(
            summary=[
                self.question,
                f"On arrival the agent that does not learn loses {plain(drop)} of its reward in the simulation, "
                f"where it explores as much (thesis: more than {thesis(__name__)['drop']:g}). Of the "
                f"causes, measured with greedy movements, the largest is: {largest} ({plain(causes[largest])}).",
                "Against the agent that does not learn, the last quarter of the movements of those that do earns "
                f"{learned}.",
                "Intervals are over arms, each the mean of its runs.",
            ],
            figures={
                "drop": number(drop),
                "causes": {name: number(found) for name, found in causes.items()},
                "last": {self.trials[t]: number(over_arms(blocks(rows, "reward", t)[:, :, -1])) for t in RATES},
            },
            sections=[self._courses(rows), _causes_section(rows, causes)],
            claims=claims,
        )

    def _courses(self, rows: Rows) -> Section:
        shown = {}
        for figure, label, factor in (
            ("reward", "reward [-]", 1.0),
            ("success_rate", "success [%]", 100.0),
            ("actions", "actions of\nsuccesses [-]", 1.0),
            ("switches", "switches of\nsuccesses [-]", 1.0),
        ):
            level = factor * mean(rows, _EXPLORING + figure, 1).mean
            shown[label] = [
                Curve(f"learning rate {rate:.2f}", factor * blocks(rows, figure, trial), level)
                for trial, rate in RATES.items()
            ]
        return Section(
            "Three agents on the arm",
            [
                "The same agent comes to the arm with three learning rates, exploring as at the end of its training. "
                "Lines without markers are the test in the simulation, exploring too."
            ],
            figures=[
                courses(
                    shown,
                    self.sizes.block,
                    "Reward, success, actions and switches over the movements since the arrival; means over arms, "
                    f"{self.sizes.block} movements a point (thesis figures 5.9 to 5.12).",
                )
            ],
        )

    def _claims(self, rows: Rows) -> list[Claim]:
        said = thesis(__name__)
        drop = over_arms(_arrival(rows, 1, "reward"))
        success = over_arms(np.mean([blocks(rows, "success_rate", t).mean(axis=-1) for t in RATES], axis=0))
        claims = [
            Claim(
                "The reward drops on arrival",
                f"more than {said['drop']:g}",
                f"lost: {plain(drop)}",
                above(drop),
                "drop",
            ),
            Claim(
                f"It drops by more than {said['drop']:g}",
                f"more than {said['drop']:g}",
                f"lost: {plain(drop)}",
                above(drop, said["drop"]),
                "drop",
            ),
            Claim(
                "Movements stay successful on the arm (97 % and more)",
                said["success"],
                f"{plain(success, 1, 100)} %",
                above(success, _NEAR_ALL),
                "arm-success",
            ),
        ]
        rise = over_arms(-_arrival(rows, 1, "actions"))
        of = f"{said['actions_simulation']:g} to {said['actions_arm']:g}"
        claims.append(
            Claim("The actions of a movement rise on arrival", of, f"by {plain(rise)}", above(rise), "drop")
        )
        for trial, thesis_rise in ((1, said["switches_rise_frozen"]), (2, said["switches_rise"])):
            rise = over_arms(-_arrival(rows, trial, "switches"))
            words = f"The switches rise on arrival, learning rate {RATES[trial]:g}"
            claims.append(Claim(words, f"by {thesis_rise:g}", f"by {plain(rise)}", above(rise), "drop"))
        course_1 = blocks(rows, "reward", 1)
        gained = over_arms(_last(course_1) - course_1[:, :, 0])
        claims.append(
            Claim(
                "Even the agent that does not learn improves, as the arm warms up",
                "yes",
                f"gained: {plain(gained)}",
                above(gained),
                "recovery",
            )
        )
        for trial in (2, 3):
            better = _better(rows, trial)
            claims.append(
                Claim(
                    f"The agent that learns with {RATES[trial]:g} ends better than the one that does not learn",
                    "yes",
                    f"better by {plain(better)}",
                    above(better),
                    "recovery",
                )
            )
        place = said["progress"] // self.sizes.block
        if place < course_1.shape[-1]:
            progress = blocks(rows, "reward", 2)
            seen = over_arms(progress[:, :, place] - progress[:, :, 0])
            claims.append(
                Claim(
                    f"With 0.05 progress is seen after some {said['progress']} movements",
                    "yes",
                    f"gained: {plain(seen)}",
                    above(seen),
                    "recovery",
                )
            )
        return claims


def changed(parameters: ArmParameters, trial: int) -> ArmParameters:
    """Return the arm under the condition of ``trial``."""
    ideal = without_noise(parameters)
    if trial == NO_NOISE:
        return replace(parameters, sensors=ideal.sensors)
    if trial == PUNCTUAL:
        return replace(parameters, jitter=ideal.jitter)
    return ideal if trial == ALL else parameters


def _arrival(rows: Rows, trial: int, figure: str) -> Any:
    """Return by how much ``figure`` is lower in the first block than in the simulation, shape (arms, runs)."""
    return values(rows, _EXPLORING + figure, trial) - values(rows, f"{figure} @1", trial)


def _last(course_: Any) -> Any:
    """Return the mean of the last quarter of courses (arms, runs, blocks)."""
    return course_[:, :, -max(1, course_.shape[-1] // 4) :].mean(axis=-1)


def _better(rows: Rows, trial: int) -> Interval:
    """Return by how much ``trial`` earns more in the end than the agent that does not learn."""
    return over_arms(_last(blocks(rows, "reward", trial)) - _last(blocks(rows, "reward", 1)))


def _causes(rows: Rows) -> dict[str, Interval]:
    """Return what each cause takes from the reward of a greedy agent."""
    from_arm, quiet = (values(rows, prefix + "reward", AS_IT_IS) for prefix in (_FROM_ARM, _WITHOUT_NOISE))
    return {
        "begin states of movements on the arm": over_arms(values(rows, SIMULATION + "reward", AS_IT_IS) - from_arm),
        "noise of the sensors": difference(rows, "reward", NO_NOISE, AS_IT_IS),
        "control that is late": difference(rows, "reward", PUNCTUAL, AS_IT_IS),
        _COLD: difference(rows, "reward", WARM, AS_IT_IS),
        _ALL_THREE: difference(rows, "reward", ALL, AS_IT_IS),
        _MODEL: over_arms(quiet - values(rows, "reward", ALL)),
        "noise that the simulation adds (a gain)": over_arms(from_arm - quiet),
    }


def _claims_on_causes(causes: Mapping[str, Interval]) -> list[Claim]:
    gap, cold = causes[_MODEL], causes[_COLD]
    return [
        Claim(
            "The gap between simulation and arm takes reward",
            "partly; no number",
            f"lost: {plain(gap)}",
            above(gap),
            _DROP,
        ),
        Claim(
            "That the arm is cold takes reward",
            "one of the reasons; no number",
            f"lost: {plain(cold)}",
            above(cold),
            _DROP,
        ),
    ]


def _causes_section(rows: Rows, causes: Mapping[str, Interval]) -> Section:
    shown = {"lost reward [-]": list(causes.values())}
    columns = [
        Column("reward", "reward"),
        Column("success_rate", "success [%]", 1, 100.0),
        Column("actions", "actions of successes"),
        Column("switches", "switches of successes"),
    ]
    simulations = [
        [words, *(replace(c, figure=prefix + c.figure).text(rows, AS_IT_IS) for c in columns)]
        for words, prefix in (
            ("simulation", SIMULATION),
            ("simulation, from the arm's begin states", _FROM_ARM),
            ("the same without noise", _WITHOUT_NOISE),
        )
    ]
    on_arm = table(rows, CONDITIONS, columns, "Greedy, without learning, the same goals and begin states on the arm.")
    both = replace(on_arm, rows=[*simulations, *on_arm.rows])
    return Section(
        "Causes of the drop",
        [
            "Each condition of the arm is compared with the arm as it is, movement by movement. The error of the "
            "model is what is left between the simulation without its noise and an arm without noise, never late "
            "and warm."
        ],
        tables=[both],
        figures=[
            dots(
                list(causes),
                shown,
                "Reward that each cause takes from a greedy agent, with 95 % intervals over arms.",
                zero=True,
            )
        ],
    )


EXPERIMENT = Transfer()
