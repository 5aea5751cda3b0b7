"""The hitch after 14 h of rest (section 5.5.1, figures 5.13, 5.14): does the agent adapt, or does the arm warm up?

The thesis saw its learning agent drop after a night and recover in 2000 movements, and could not tell whether the
agent or the arm had come back. Here an agent moves for a day, the arm rests, and it moves again: learning on both
days, learning on the first alone, or never learning (so that what comes back is the arm); and one that learns on
without a night, because what a learning agent earns goes up and down anyway.

    pneumarm experiment overnight

On arms 1 to 5, four runs each, there is no hitch: the agent that never learns loses -0.1 ± 2.6 of its reward after 14
h, and the one that learns -1.2 ± 5.1 against the same agent without a night. There is nothing to be seen that warming
up or learning would bring back.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

from pneumarm.control.playing import Player
from pneumarm.experiments.differences import Interval, above
from pneumarm.experiments.evidence import blocks, number, over_arms, plain, thesis
from pneumarm.experiments.experiment import Analysis, Claim, Figures, LaboratorySettings, Rows, run_seed
from pneumarm.experiments.moving import MOVEMENTS, Material, OnTheArm, agent_of, course, draws, new_arm
from pneumarm.experiments.pictures import Curve, courses
from pneumarm.report.page import Picture, Section, Table
from pneumarm.task.movements import joined


class Days(NamedTuple):
    """What is done on the first day and on the second."""

    words: str
    first: bool
    """Whether the agent learns on the first day."""
    second: bool
    night: bool = True
    """Whether there is a night between them."""


LEARNING, FIRST_DAY, FROZEN, NO_NIGHT = range(1, 5)
DAYS = {
    LEARNING: Days("learning on both days", True, True),
    FIRST_DAY: Days("learning on the first day", True, False),
    FROZEN: Days("never learning", False, False),
    NO_NIGHT: Days("learning, no night between", True, True, night=False),
}


@dataclass(frozen=True)
class Sizes:
    """How much is moved in a row."""

    first: int = 1000
    """Movements before the night."""
    second: int = 1000
    """Movements after it."""
    block: int = 100
    """Movements in a point of the courses."""
    hours: float = 14.0
    """Of rest [h]."""
    learning_rate: float = 0.05
    """Of agents that learn (thesis: 0.05)."""


@dataclass(frozen=True)
class Overnight(OnTheArm):
    """Two days with a night between."""

    name: str = "overnight"
    title: str = "After a night of rest"
    question: str = "Is it the agent that adapts after a night, or the arm that warms up?"
    source: str = "Thesis section 5.5.1, figures 5.13 and 5.14"
    sizes: Sizes = Sizes()

    @property
    def trials(self) -> Mapping[int, str]:
        """Who learns when."""
        return {trial: days.words for trial, days in DAYS.items()}

    def measure(self, material: Material, trial: int, run: int, settings: LaboratorySettings) -> Figures:
        """Move for two days, exploring as at the end of training on both."""
        sizes, days, seed = self.sizes, DAYS[trial], run_seed(settings, run)
        agent, arm = agent_of(material, self.agent, run, settings), new_arm(material, run, settings)
        explores, rate = self.agent.exploration, sizes.learning_rate
        first = Player(agent, arm, rate if days.first else 0.0, explores, seed)
        day = first.play(*draws(agent, seed, sizes.first, MOVEMENTS))
        if days.night:
            arm.rest(3600 * sizes.hours)
        second = Player(first.learned, arm, rate if days.second else 0.0, explores, seed + 1)
        next_day = second.play(*draws(agent, seed, sizes.second, MOVEMENTS, sizes.first))
        return course(joined([day, next_day]), sizes.block)

    def analyse(self, rows: Rows) -> Analysis:
        """Return the drop after the night and what brings the reward back."""
        rewards = {trial: blocks(rows, "reward", trial) for trial in DAYS}
        place = self.sizes.first // self.sizes.block
        found = {trial: _hitch(reward, place) for trial, reward in rewards.items()}
        lost = over_arms((rewards[NO_NIGHT] - rewards[LEARNING])[:, :, place])
        adapted = over_arms(_gain(rewards[LEARNING], place) - _gain(rewards[NO_NIGHT], place))
        names = ["trial", "drop to the second day", "gained on the second day"]
        lines = [[days.words, *(plain(one) for one in found[trial])] for trial, days in DAYS.items()]
        return Analysis(
            summary=[
                self.question,
                answer(lost, found[FROZEN][0]),
                f"Reward lost by the night: {plain(lost)} of an agent that learns, against the same agent without "
                f"one, and {plain(found[FROZEN][0])} of one that never learns. Gained on the second day: "
                f"{plain(found[FROZEN][1])} by the latter, while the arm warms up; and by learning after a night "
                f"{plain(adapted)} more than by learning without one.",
                "Intervals are over arms, each the mean of its runs.",
            ],
            figures={
                "drop": {DAYS[t].words: number(one[0]) for t, one in found.items()},
                "gain": {DAYS[t].words: number(one[1]) for t, one in found.items()},
                "lost": number(lost),
                "adapted": number(adapted),
            },
            sections=[
                Section(
                    "Two days on the arm",
                    [
                        f"The drop is the reward of the last {_SPAN * self.sizes.block} movements of the first day "
                        f"less that of the first {self.sizes.block} of the second; the gain is from there to the "
                        f"last {_SPAN * self.sizes.block} of the second day. All explore alike. Without a night the "
                        "first day is the same, movement by movement. An agent that is frozen in the evening also "
                        "loses what learning on would have mended, night or not: its weights are those of a moment."
                    ],
                    tables=[Table(names, lines, "Reward, means over arms with 95 % intervals.")],
                    figures=[self._picture(rows)],
                )
            ],
            claims=_claims(found[FROZEN], lost, adapted),
        )

    def _picture(self, rows: Rows) -> Picture:
        shown = {
            label: [Curve(days.words, blocks(rows, figure, trial)) for trial, days in DAYS.items()]
            for figure, label in (
                ("reward", "reward [-]"),
                ("actions", "actions of\nsuccesses [-]"),
                ("switches", "switches of\nsuccesses [-]"),
            )
        }
        marks = {float(self.sizes.first): f"{self.sizes.hours:g} h of rest"}
        caption = "Reward, actions and switches before and after a night (thesis figures 5.13 and 5.14)."
        return courses(shown, self.sizes.block, caption, marks)


def answer(lost: Interval, frozen: Interval) -> str:
    """Return in words for whom the night surely costs reward."""
    agents = {"an agent that learns": lost, "one that never learns": frozen}
    costs = [words for words, found in agents.items() if above(found) == "holds"]
    if costs:
        return f"The night costs {' and '.join(costs)} reward."
    return "No drop is shown, so that it cannot be seen what would bring the reward back."


_SPAN = 3  # blocks before the night, and at the end, that are the level of a day


def _span(place: int) -> int:
    return min(_SPAN, place)


def _gain(course_: Any, place: int) -> Any:
    """Return what is gained from the first block of the second day to its end, shape (arms, runs)."""
    span = _span(course_.shape[-1] - place)
    return course_[:, :, -span:].mean(axis=-1) - course_[:, :, place]


def _hitch(course_: Any, place: int) -> tuple[Interval, Interval]:
    """Return the drop after the night and the gain of the second day."""
    before = course_[:, :, place - _span(place) : place].mean(axis=-1)
    return over_arms(before - course_[:, :, place]), over_arms(_gain(course_, place))


def _claims(frozen: tuple[Interval, Interval], lost: Interval, adapted: Interval) -> list[Claim]:
    said = thesis(__name__)
    recovers = f"within {said['recovery']} movements"
    drop, warmed = frozen
    return [
        Claim(
            f"{said['hours']:g} h of rest cost the learning agent reward",
            "a sudden drop",
            f"lost: {plain(lost)}",
            above(lost),
            "overnight",
        ),
        Claim(
            "They cost an agent that does not learn reward",
            "expected",
            f"lost: {plain(drop)}",
            above(drop),
            "overnight",
        ),
        Claim(
            "The arm itself comes back as it warms up",
            recovers,
            f"gained: {plain(warmed)}",
            above(warmed),
            "overnight",
        ),
        Claim(
            "The agent adapts: learning brings back more",
            recovers,
            f"gained more: {plain(adapted)}",
            above(adapted),
            "overnight",
        ),
    ]


EXPERIMENT = Overnight()
