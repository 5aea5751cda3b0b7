"""How fast a policy adapts to an arm that has changed, against no adaptation and against an agent trained afresh.

For every seed an arm is drawn, and an agent collects, fits and trains on it. Then the arm changes (CHANGES), and
three baselines make the same movements, from the same begin states (by seed) to the same goals, on arms in the same
state:

    fresh     an agent that collected, fitted and trained anew on the changed arm: the reference; of an arm that has
              not changed it is the old agent
    without   the old agent, which stays as it is
    adapting  the old agent, which adapts between movements

Goals lie within the reach of the changed arm, the 1st to 99th percentile of its angles in the fresh agent's
collecting, and within the range of the old agent. Every transfer is a row in a file; those that are there are not
made again.

*Recovered* is the first movement from which on the mean reward of every 100 following movements is at least 95 % of
what the fresh agent gets in those same movements; its time is that of the arm, the ways to the begin states included.
Settings come from the environment:

PNEUMARM_ADAPTATION_SEEDS      seeds of virtual arms, "1,2,3,4,5"; the held-out arms are 1001 to 1010
PNEUMARM_ADAPTATION_CHANGES    names from CHANGES; all by default
PNEUMARM_ADAPTATION_MOVEMENTS  movements of each baseline, 300
PNEUMARM_ADAPTATION_COLLECTED  transitions that the fresh agent collects, 200000
PNEUMARM_ADAPTATION_FOLDER     where stores, simulations, agents, rows and the picture are kept; a temporary folder
                               by default
"""

import json
import tempfile
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.stats import t as student

from benchmarks import _environment as environment
from benchmarks.agents import prepared
from pneumarm.adaptation import AdaptationSettings, TrialSettings, WatchSettings
from pneumarm.adaptation.change import ChangeDetector
from pneumarm.adaptation.trial import lower_by
from pneumarm.arm import guarded
from pneumarm.arm.virtual import ArmParameters, VirtualArm, draw_parameters
from pneumarm.arm.virtual.parameters import JointParameters, MuscleParameters
from pneumarm.control import BEGIN, TransferSettings, transfer
from pneumarm.drawing.colours import DARK, GREY, LIGHT, MIDDLE
from pneumarm.files import write_json
from pneumarm.learning import PolicyAgent, PolicySettings, train
from pneumarm.report.style import key, legend_below, panels, styled
from pneumarm.simulation import SINGLE_STEPS, fit_store
from pneumarm.statistics import moving_mean
from pneumarm.task import begin_states
from pneumarm.task.movements import join_movements
from pneumarm.transitions import KINDS, WHOLE_PERIODS, Store, collect

Floats = NDArray[np.float64]
NIGHT = 14 * 3600.0
"""A rest [s] of a rested arm."""
WORN_IN = 600
"""Begin states that a rested arm was brought to before, in about three quarters of an hour."""
TORN = 300
"""How much more than a sound one a torn muscle leaks: 7.5 % of its pressure a second."""
WINDOW, SHARE = 100, 0.95
"""Of the definition of *recovered*."""
FOLDER = "PNEUMARM_ADAPTATION_FOLDER"
BASELINES = ("fresh", "without", "adapting")


# What changes -----------------------------------------------------------------------------------------------------


def each_joint(parameters: ArmParameters, change: Callable[[JointParameters], JointParameters]) -> ArmParameters:
    return replace(parameters, joints=tuple(change(joint) for joint in parameters.joints))


def first_muscle(joint: JointParameters, change: Callable[[MuscleParameters], MuscleParameters]) -> JointParameters:
    return replace(joint, muscles=(change(joint.muscles[0]), joint.muscles[1]))


def each_muscle(joint: JointParameters, change: Callable[[MuscleParameters], MuscleParameters]) -> JointParameters:
    first, second = joint.muscles
    return replace(joint, muscles=(change(first), change(second)))


def heavier(parameters: ArmParameters, seed: int) -> ArmParameters:
    """A payload 30 % heavier."""
    return each_joint(parameters, lambda joint: replace(joint, mass=1.3 * joint.mass))


def exchanged(parameters: ArmParameters, seed: int) -> ArmParameters:
    """Muscle 1 is that of another draw."""
    other = draw_parameters(100 + seed).joints[0].muscles[0]
    return each_joint(parameters, lambda joint: first_muscle(joint, lambda muscle: other))


def leaking(parameters: ArmParameters, seed: int) -> ArmParameters:
    """Muscles leak three times as much: some 5 % of their pressure a minute."""
    return each_joint(
        parameters, lambda joint: each_muscle(joint, lambda muscle: replace(muscle, leak=3 * muscle.leak))
    )


def torn(parameters: ArmParameters, seed: int) -> ArmParameters:
    """Muscle 1 leaks so much that it loses half of its pressure in ten seconds."""
    return each_joint(
        parameters, lambda joint: first_muscle(joint, lambda muscle: replace(muscle, leak=TORN * muscle.leak))
    )


def same(parameters: ArmParameters, seed: int) -> ArmParameters:
    return parameters


CHANGES = {"unchanged": same, "rested": same, "leak": leaking, "payload": heavier, "torn": torn, "muscle": exchanged}
WORDS = {
    "unchanged": "nothing has changed",
    "rested": "rested for 14 h",
    "leak": "muscles leak three times as much",
    "payload": "30 % more payload",
    "torn": f"muscle 1 leaks {TORN} times as much",
    "muscle": "muscle 1 exchanged",
}


def changed_arm(change: str, seed: int, noise: int) -> VirtualArm:
    arm = VirtualArm(CHANGES[change](draw_parameters(seed), seed), seed=noise)
    if change == "rested":
        random = np.random.default_rng(seed)
        for _ in range(WORN_IN):
            BEGIN.reach(guarded(arm), random)
        arm.rest(NIGHT)
    return arm


# The baselines -----------------------------------------------------------------------------------------------------


class Bench:
    """A folder of stores, simulations, agents and rows."""

    def __init__(self, folder: Path, movements: int, collected: int) -> None:
        self.folder, self.movements, self.collected = folder, movements, collected

    def row(self, change: str, seed: int, baseline: str) -> dict[str, Any]:
        """Return what a baseline did; let it move where that is not done yet."""
        file = self.folder / f"{change}-{seed}-{baseline}-{self.movements}-{self.collected}.json"
        if not file.exists():
            write_json(file, self.measure(change, seed, baseline))
        found: dict[str, Any] = json.loads(file.read_text())
        return found

    def measure(self, change: str, seed: int, baseline: str) -> dict[str, Any]:
        old = self.trained(seed, None)
        fresh = old if change == "unchanged" else self.trained(seed, change)
        low = np.maximum(old.goal_range[:, 0], fresh.goal_range[:, 0])
        high = np.minimum(old.goal_range[:, 1], fresh.goal_range[:, 1])
        agent = fresh if baseline == "fresh" else old
        agent = replace(agent, simulation=replace(agent.simulation, goal_range=np.stack([low, high], axis=1)))
        settings = TransferSettings(
            episodes=self.movements, test_episodes=1, learning_rate=0.01 if baseline == "adapting" else 0.0
        )
        arm = changed_arm(change, seed, 2000 + seed)
        with tempfile.TemporaryDirectory() as place, Store.for_arm(Path(place) / "db", arm.spec) as store:
            moved = transfer(agent, arm, store, settings, seed=seed)
        made = join_movements([moved.movements["before"], moved.movements["learning"]])
        assert moved.adapted is not None
        return {
            "change": change,
            "seed": seed,
            "baseline": baseline,
            "reward": made.reward.tolist(),
            "success": made.success.tolist(),
            "time": (made.time_end - made.time_start[0]).tolist(),
            "squares": np.round(moved.adapted.squares[: made.n, 1], 4).tolist(),
            "events": [asdict(event) for event in moved.adapted.events if event.what != "refused"],
            "goal_range": agent.goal_range.tolist(),
        }

    def trained(self, seed: int, change: str | None) -> PolicyAgent:
        """Return the policy trained on an arm as drawn, or after a ``change``; train it where there is none."""
        file = self.folder / (f"{seed}.agent" if change is None else f"{change}-{seed}-{self.collected}.agent")
        if not file.exists():
            named = f"virtual:seed={seed}"
            simulation, begin = prepared(self.folder, named) if change is None else self.prepared_anew(seed, change)
            train(simulation, begin, PolicySettings(), 1).agent.save(file)
        return PolicyAgent.load(file)

    def prepared_anew(self, seed: int, change: str) -> tuple[Any, Any]:
        with tempfile.TemporaryDirectory() as place:
            arm = changed_arm(change, seed, 3000 + seed)
            with Store.for_arm(Path(place) / "db", arm.spec) as store:
                collect(arm, store, self.collected, seed, settings=WHOLE_PERIODS)
                simulation = fit_store(store, replace(SINGLE_STEPS, seed=seed)).simulation
                return simulation, begin_states(
                    store.blocks(kinds=KINDS), simulation.window, simulation.scaling, simulation.spec
                )


# The table --------------------------------------------------------------------------------------------------------

HEADER = (
    f"{'change':10}{'right after':>12}{'first 100 movements':>35}{'last 100 movements':>28}"
    f"{'recovered without':>19}{'adapting':>27}{'noticed':>20}{'back':>5}\n"
    f"{'':10}{'without':>12}{'adapting':>10}{'without':>9}{'gain':>16}{'fresh':>9}{'without':>9}{'adapting':>10}"
    f"{'movements':>19}{'movements':>13}{'minutes':>14}{'movement':>20}"
)


def measure() -> Iterator[str]:
    seeds = environment.seeds("PNEUMARM_ADAPTATION_SEEDS", "1,2,3,4,5")
    changes = environment.words("PNEUMARM_ADAPTATION_CHANGES", ",".join(CHANGES))
    movements = environment.whole("PNEUMARM_ADAPTATION_MOVEMENTS", 300)
    collected = environment.whole("PNEUMARM_ADAPTATION_COLLECTED", 200_000)
    with environment.kept_folder(FOLDER) as folder:
        bench, found = Bench(folder, movements, collected), {}
        yield HEADER
        for change in changes:
            found[change] = [
                {baseline: bench.row(change, seed, baseline) for baseline in BASELINES} for seed in seeds
            ]
            yield line(change, found[change])
        yield from rates(found)
        if environment.text(FOLDER, ""):
            curves(found).savefig(folder / "adaptation.png", dpi=150)
            yield f"curves: {folder / 'adaptation.png'}"


def line(change: str, rows: list[dict[str, dict[str, Any]]]) -> str:
    """Return the line of a change: means over seeds; movements and minutes of each seed."""
    rewards = {baseline: np.array([row[baseline]["reward"] for row in rows]) for baseline in BASELINES}
    without, adapting = rewards["without"], rewards["adapting"]
    gain, half = over_seeds((adapting - without)[:, :100].mean(axis=1))
    last = {baseline: reward[:, -100:].mean() for baseline, reward in rewards.items()}
    recovered = {
        baseline: [recovery(row[baseline], row["fresh"]) for row in rows] for baseline in ("without", "adapting")
    }
    noticed = [
        next((e["movement"] for e in row["without"]["events"] if e["what"] == "noticed"), None) for row in rows
    ]
    back = sum(e["what"] == "rolled back" for row in rows for e in row["adapting"]["events"])
    return (
        f"{change:10}{without[:, :50].mean():12.1f}{adapting[:, :100].mean():10.1f}{without[:, :100].mean():9.1f}"
        f"{f'{gain:+.2f} ± {half:.2f}':>16}{last['fresh']:9.1f}{last['without']:9.1f}{last['adapting']:10.1f}"
        f"{listed([m for m, _ in recovered['without']]):>19}{listed([m for m, _ in recovered['adapting']]):>13}"
        f"{listed([minutes for _, minutes in recovered['adapting']]):>14}{listed(noticed):>20}{back:5d}"
    )


def listed(values: list[int | None]) -> str:
    return " ".join("-" if value is None else str(value) for value in values)


def over_seeds(values: Floats) -> tuple[float, float]:
    """Return the mean over seeds and half of its 95 % interval, by Student's t."""
    n = len(values)
    if n < 2:
        return float(values.mean()), float("nan")
    return float(values.mean()), float(student.ppf(0.975, n - 1) * values.std(ddof=1) / np.sqrt(n))


def recovery(row: Mapping[str, Any], fresh: Mapping[str, Any]) -> tuple[int | None, int | None]:
    """Return the movements and minutes until the reward is recovered for good; None where it is not."""
    mine, reference = (np.convolve(one["reward"], np.ones(WINDOW) / WINDOW, "valid") for one in (row, fresh))
    below = np.flatnonzero(mine < SHARE * reference)
    first = int(below[-1]) + 1 if len(below) else 0
    if first == len(mine):
        return None, None
    return first, round((row["time"][first - 1] if first else 0.0) / 60)


def rates(found: Mapping[str, list[dict[str, dict[str, Any]]]]) -> Iterator[str]:
    """Say how often an arm that has hardly changed is noticed, and an agent that is no worse would be taken back."""
    calm = [row["without"] for change in ("unchanged", "rested", "leak") for row in found.get(change, [])]
    if not calm:
        return
    alarms = movements = 0
    for row in calm:
        watch = ChangeDetector(WatchSettings(), len(row["squares"][0]))
        for squares in row["squares"]:
            movements += 1
            if watch.observe(squares):
                alarms += 1
                watch.reset()
    yield f"false alarms: {alarms} in {movements} movements of arms that have not, or hardly, changed"
    trial, random = TrialSettings(), np.random.default_rng(0)
    taken = tries = 0
    for row in calm:
        for known in (AdaptationSettings().first, trial.remembered):
            for _ in range(200):
                tries += 1
                old, new = random.choice(row["reward"], known), random.choice(row["reward"], trial.looks[-1])
                taken += any(lower_by(old, new[:look]) > trial.limit for look in trial.looks)
    yield f"taken back though no worse: {taken / tries:.2%} of {tries} trials on rewards drawn anew from these arms"


@styled
def curves(found: Mapping[str, list[dict[str, dict[str, Any]]]]) -> Figure:
    """Draw the reward of the baselines over the movements, one panel for each change."""
    rows = -(-len(found) // 2)
    figure, axes = panels(rows, 2, 0.6 + 2.0 * rows, sharex=True)
    looks = {"fresh": (GREY, ":"), "without": (MIDDLE, "--"), "adapting": (DARK, "-")}
    for place, (change, each) in zip(axes.ravel(), found.items(), strict=False):
        lowest = np.inf
        for baseline, (color, dashes) in looks.items():
            smooth = np.array([moving_mean(row[baseline]["reward"], 50).mean for row in each])
            mean = smooth.mean(axis=0)
            lowest = min(lowest, mean.min())
            if baseline == "adapting" and len(each) > 1:
                half = np.array([over_seeds(column)[1] for column in smooth.T])
                place.fill_between(np.arange(len(mean)), mean - half, mean + half, color=LIGHT, alpha=0.5, lw=0)
            place.plot(mean, color=color, ls=dashes)
        place.set_title(WORDS[change])
        place.set_ylabel("reward [-]")
        place.set_ylim(lowest - 2, 43)
        place.margins(x=0)
    for place in axes.ravel()[: len(found)][-2:]:
        place.set_xlabel("movements on the arm [-]")
        place.tick_params(labelbottom=True)
    for place in axes.ravel()[len(found) :]:
        place.set_visible(False)
    handles = [key(color, dashes) for color, dashes in looks.values()]
    legend_below(figure, handles, ["trained afresh", "not adapting", "adapting (95 % interval over seeds)"])
    return figure
