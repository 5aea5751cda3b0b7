"""Actions and switches by displacement, typical movements, and small displacements as the hard case (section 5.5.2).

The agent of trial 10 learns on the arm with 0.10 until it has adapted, and the movements after that are looked at,
still learning and exploring. Then it makes movements of 5, 30 and 60 degrees greedily, as in figures 5.17 to 5.19,
and what the arm does after the goal is reached is recorded too.

Differences from the thesis: 1000 movements to adapt, not 2500; 60 degrees, not 70, which is more than the range of
goals of some arms.

    pneumarm experiment displacement

Answer here, on five arms: actions grow with the displacement and switches less so, as in the thesis. Short movements
switch more often an action and go farther out of the way, but by 1.3 ± 0.7 degrees, not 20, and they succeed as often
as long ones. A quarter of the movements of this learning agent switch more than five times, in the thesis a few.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm import ArmSpec, ControlCycle, Reading, guarded
from pneumarm.arm.virtual import VirtualArm
from pneumarm.control.agent import AgentController
from pneumarm.control.movement import move
from pneumarm.control.playing import Player
from pneumarm.control.transfer import BEGIN
from pneumarm.experiments.differences import Interval, above
from pneumarm.experiments.evidence import (
    from_series,
    mean,
    number,
    over_arms,
    plain,
    series,
    series_of,
    thesis,
    values,
)
from pneumarm.experiments.experiment import Analysis, Claim, Figures, LaboratorySettings, Rows, run_seed
from pneumarm.experiments.moving import MOVEMENTS, Material, OnTheArm, agent_of, draws, new_arm
from pneumarm.learning import Agent
from pneumarm.report.figures import against_displacement, against_displacement_alt, movement, movement_alt
from pneumarm.report.page import Picture, Section, Table

Array = NDArray[np.float64]
Counts = NDArray[np.int64]
_TYPICAL = 4  # stream of random numbers
_TRIES = 200  # begin states until one allows the displacement
_AFTER = 0.8  # s that are recorded after the goal is reached
_SERIES = ("time", "angle", "pressure 1", "pressure 2", "valve 1", "valve 2")


@dataclass(frozen=True)
class Sizes:
    """How much is moved in a row."""

    adapting: int = 1000
    """Movements while the agent adapts."""
    shown: int = 300
    """Movements after that, which are looked at."""
    typical: int = 10
    """Movements of each typical displacement."""
    degrees: tuple[float, float, float] = (5.0, 30.0, 60.0)
    """Typical displacements [degrees]: small, middle, large (thesis figures 5.18, 5.17, 5.19: 5, 30, 70)."""
    learning_rate: float = 0.10
    """On the arm (thesis: 0.10)."""


@dataclass(frozen=True)
class Typical:
    """A movement of a given displacement: all that was read, also after its end."""

    time: Array
    """Shape (n,) [s]."""
    angle: Array
    """Shape (n, joints) [counts]."""
    pressure: Array
    """Shape (n, joints, 2) [counts]."""
    valves: Array
    """Shape (n, joints, 2)."""
    goal: Array
    """Shape (joints,) [counts]."""
    end: float | None
    """When the goal was reached [s], or None."""

    @property
    def beyond(self) -> float:
        """How far the first joint went out of the way between begin and goal until the end [counts]."""
        until = self.time <= (np.inf if self.end is None else self.end)
        angle = self.angle[until, 0]
        low, high = sorted((self.angle[0, 0], self.goal[0]))
        return float(max(0.0, low - angle.min(), angle.max() - high))

    @property
    def ringing(self) -> float:
        """How far it is from the goal at most after it was reached [counts]; NaN where it was not."""
        if self.end is None:
            return float("nan")
        return float(np.abs(self.angle[self.time >= self.end, 0] - self.goal[0]).max())


@dataclass(frozen=True)
class Displacement(OnTheArm):
    """What movements look like, short and long."""

    name: str = "displacement"
    title: str = "Movements by displacement"
    question: str = "How do actions and switches depend on the displacement, and why are small displacements hard?"
    source: str = "Thesis section 5.5.2, figures 5.15 to 5.19"
    sizes: Sizes = Sizes()

    @property
    def trials(self) -> Mapping[int, str]:
        """The one agent."""
        return {1: f"learning rate {self.sizes.learning_rate:g}"}

    def measure(self, material: Material, trial: int, run: int, settings: LaboratorySettings) -> Figures:
        """Adapt, move, and make the typical movements."""
        sizes, seed = self.sizes, run_seed(settings, run)
        agent, arm = agent_of(material, self.agent, run, settings), new_arm(material, run, settings)
        player = Player(agent, arm, sizes.learning_rate, self.agent.exploration, seed)
        player.play(*draws(agent, seed, sizes.adapting, MOVEMENTS))
        made = player.play(*draws(agent, seed, sizes.shown, MOVEMENTS, sizes.adapting))
        distance = made.distance[:, 0]
        won, switches = made.success, made.switches.sum(axis=1)
        found = {
            **relations(distance[won], made.actions[won], switches[won]),
            **thirds(distance, made.actions, switches, won),
            **series("distance", distance[won]),
            **series("actions", made.actions[won]),
            **series("switches", switches[won]),
        }
        for degrees in sizes.degrees:
            found |= _typical(player.learned, arm, degrees, sizes.typical, seed)
        return found

    def analyse(self, rows: Rows) -> Analysis:
        """Return the pictures of section 5.5.2 and what they say."""
        spec = ArmSpec()
        points = [series_of(rows, name, 1) for name in ("distance", "actions", "switches")]
        distance, actions, switches = points[0][:, None], points[1], points[2]
        ratio = over_arms(values(rows, "ratio, short", 1) - values(rows, "ratio, long", 1))
        failed = over_arms(values(rows, "success, short", 1) - values(rows, "success, long", 1))
        return Analysis(
            summary=[
                self.question,
                f"{len(actions):,} successful movements after adapting. The correlation with the displacement is "
                f"{plain(mean(rows, 'correlation of actions', 1))} for actions and "
                f"{plain(mean(rows, 'correlation of switches', 1))} for switches; the shortest third makes "
                f"{plain(ratio)} more switches an action than the longest, and its success is "
                f"{plain(failed, 1, 100)} points above that of the longest. Intervals are over arms, each the mean "
                "of its runs.",
            ],
            figures={
                name: number(mean(rows, name, 1))
                for name in sorted(set.intersection(*(set(row.figures) for row in rows.rows)))
                if "#" not in name
            },
            sections=[
                Section(
                    "By displacement",
                    figures=[
                        Picture(
                            against_displacement(distance, actions, switches, spec),
                            "Actions and switches of successful movements against the displacement (thesis figures "
                            "5.15 and 5.16).",
                            against_displacement_alt(distance, actions, switches, spec),
                        )
                    ],
                    tables=[_thirds_table(rows)],
                ),
                _typical_section(rows, spec, self.sizes.degrees),
            ],
            claims=_claims(rows, ratio, self.sizes.degrees),
        )


def relations(distance: Array, actions: Counts, switches: Counts) -> dict[str, float]:
    """Return correlations with the displacement, and the share of movements with few switches."""
    found = {"few switches": float((switches <= thesis(__name__)["most_switches"]).mean())} if len(switches) else {}
    for name, counts in (("actions", actions), ("switches", switches)):
        if len(distance) > 1 and distance.std() > 0 and counts.std() > 0:
            found[f"correlation of {name}"] = float(np.corrcoef(distance, counts)[0, 1])
    return found


def thirds(distance: Array, actions: Counts, switches: Counts, won: NDArray[np.bool_]) -> dict[str, float]:
    """Return means of the third of the movements with the shortest and the longest displacements."""
    third, two_thirds = np.percentile(distance, (100 / 3, 200 / 3))
    found = {}
    for name, members in (("short", distance <= third), ("long", distance >= two_thirds)):
        found[f"success, {name}"] = float(won[members].mean())
        if (members & won).any():
            these = actions[members & won], switches[members & won]
            found |= {f"actions, {name}": float(these[0].mean()), f"switches, {name}": float(these[1].mean())}
            found[f"ratio, {name}"] = float(these[1].sum() / these[0].sum())
    return found


def _thirds_table(rows: Rows) -> Table:
    lines = [
        [words, *(plain(mean(rows, f"{name}, {key}", 1), digits, factor) for name, digits, factor in _THIRDS)]
        for words, key in (("shortest third", "short"), ("longest third", "long"))
    ]
    header = ["displacement", "success [%]", "actions", "switches", "switches an action"]
    return Table(header, lines, "Means over arms with 95 % intervals; all but success of successful movements.")


_THIRDS = (("success", 1, 100.0), ("actions", 2, 1.0), ("switches", 2, 1.0), ("ratio", 3, 1.0))


def typical_movement(agent: Agent, arm: VirtualArm, degrees: float, random: np.random.Generator) -> Typical | None:
    """Let ``agent`` move greedily by ``degrees`` from a random begin state; None where none allows that.

    The direction is the one in which there is more workspace. All joints move alike.
    """
    cycle = ControlCycle(guarded(arm))
    step = degrees * arm.spec.counts_per_degree
    low, high = agent.goal_range.T
    for _ in range(_TRIES):
        BEGIN.reach(cycle.arm, random)
        angle = arm.read().angle
        goal = np.where(angle - low > high - angle, angle - step, angle + step)
        if ((goal >= low) & (goal <= high)).all():
            break
    else:
        return None
    made = move(cycle, AgentController(agent), goal, agent.settings.reward, agent.settings.cutoff)
    recorded = made.recorded
    turns = len(recorded.angle)
    after: list[Reading] = []
    while not after or after[-1].time < made.time_end + _AFTER:
        arm.wait(arm.spec.period)
        after.append(arm.read())
    still = np.zeros((len(after) + 1, *recorded.pressure.shape[1:]))
    return Typical(
        time=np.concatenate([recorded.time, [reading.time for reading in after]]) - made.time_start,
        angle=np.concatenate([recorded.angle, [reading.angle for reading in after]]),
        pressure=np.concatenate([recorded.pressure, [reading.pressure for reading in after]]),
        valves=np.concatenate([np.asarray(recorded.command, np.float64)[: turns - 1], still]),
        goal=goal,
        end=made.time_end - made.time_start if made.success else None,
    )


def _typical(agent: Agent, arm: VirtualArm, degrees: float, count: int, seed: int) -> dict[str, float]:
    """Return what movements by ``degrees`` have in common, and the first of them."""
    random = np.random.default_rng([seed, _TYPICAL, round(degrees)])
    made = [one for _ in range(count) if (one := typical_movement(agent, arm, degrees, random)) is not None]
    if not made:
        return {}
    per = arm.spec.counts_per_degree
    name = f"{degrees:g}°: "
    reached = [one for one in made if one.end is not None]
    found = {
        name + "success": len(reached) / len(made),
        name + "out of the way": float(np.mean([one.beyond for one in made])) / per,
    }
    if reached:
        found[name + "ringing"] = float(np.mean([one.ringing for one in reached])) / per
        found[name + "seconds"] = float(np.mean([one.end for one in reached]))
    first = made[0]
    columns = [first.time, first.angle[:, 0], *first.pressure[:, 0].T, *first.valves[:, 0].T]
    for label, column in zip(_SERIES, columns, strict=True):
        found |= series(name + label, column)
    return {**found, name + "goal": float(first.goal[0]), **({} if first.end is None else {name + "end": first.end})}


def _typical_section(rows: Rows, spec: ArmSpec, displacements: Sequence[float]) -> Section:
    lines, pictures = [], []
    for degrees, figure in zip(displacements, ("5.18", "5.17", "5.19"), strict=True):
        name = f"{degrees:g}°: "
        known = [row.figures for row in rows.rows if name + "goal" in row.figures]
        if not known:
            continue
        lines.append(
            [
                f"{degrees:g}°",
                plain(mean(rows, name + "success", 1), 1, 100),
                plain(mean(rows, name + "seconds", 1)),
                plain(mean(rows, name + "out of the way", 1), 1),
                plain(mean(rows, name + "ringing", 1), 1),
            ]
        )
        first = known[0]
        time, angle, p1, p2, v1, v2 = (from_series(first, name + label) for label in _SERIES)
        drawn = (
            time,
            angle[:, None],
            np.stack([p1, p2], axis=-1)[:, None],
            np.stack([v1, v2], axis=-1)[:, None],
            np.array([first[name + "goal"]]),
            first.get(name + "end"),
            spec,
        )
        caption = f"A movement by {degrees:g}° on {rows.rows[0].arm} (thesis figure {figure})."
        pictures.append(Picture(movement(*drawn), caption, movement_alt(*drawn)))
    header = ["displacement", "success [%]", "time [s]", "out of the way [°]", "ringing [°]"]
    return Section(
        "Typical movements",
        [
            "Out of the way is how far the angle leaves the range between begin and goal before the goal is reached; "
            f"ringing is the largest distance from the goal in the {_AFTER:g} s after that, the valves closed."
        ],
        tables=[Table(header, lines, "Greedy movements after adapting; means over arms with 95 % intervals.")],
        figures=pictures,
    )


def _claims(rows: Rows, ratio: Interval, displacements: tuple[float, float, float]) -> list[Claim]:
    said = thesis(__name__)
    small, middle, large = (f"{degrees:g}°" for degrees in displacements)
    of_actions, few = mean(rows, "correlation of actions", 1), mean(rows, "few switches", 1)
    less = over_arms(values(rows, "correlation of actions", 1) - values(rows, "correlation of switches", 1))
    short, long = (mean(rows, f"{which}: out of the way", 1) for which in (small, large))
    harder = over_arms(values(rows, f"{small}: out of the way", 1) - values(rows, f"{large}: out of the way", 1))
    ringing = mean(rows, f"{middle}: ringing", 1)
    return [
        Claim(
            "Actions grow clearly with the displacement: the correlation is above 0.5",
            said["relation"],
            f"correlation {plain(of_actions)}",
            above(of_actions, 0.5),
            "displacement",
        ),
        Claim(
            "Switches depend on it less",
            said["relation"],
            f"correlation less by {plain(less)}",
            above(less),
            "displacement",
        ),
        Claim(
            "Short movements make more switches an action: they are less smooth",
            said["ratio"],
            f"more by {plain(ratio)}",
            above(ratio),
            "small-displacements",
        ),
        Claim(
            "Only a few movements switch more than five times (5 % at most)",
            "only a few",
            f"{plain(few, 1, 100)} % do not",
            above(few, 0.95),
            "displacement",
        ),
        Claim(
            f"Movements of {small} go farther out of the way than those of {large}",
            f"{said['excursion']:g}° in figure 5.18",
            f"{_degrees(short)} against {_degrees(long)}",
            above(harder),
            "small-displacements",
        ),
        Claim(
            f"After a movement of {middle} the arm rings by {said['damping']:g}° and more",
            f"{said['damping']:g}° in figure 5.17",
            _degrees(ringing),
            above(ringing, said["damping"]),
            "ringing",
        ),
    ]


def _degrees(found: Interval) -> str:
    return f"{plain(found, 1)}°" if found.samples else "no such movements"


EXPERIMENT = Displacement()
