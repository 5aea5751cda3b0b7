"""Which part of the agent that reaches goals with several joints earns what: the agent without each of them.

python -m benchmarks parts

Every arm is recorded and fitted once, and all agents make the same movements on it as they arrive, learning nothing.
Differences to the agent as it is are of the same movements; their intervals are Student's, over the pairs of arm and
seed. Settings come from the environment:

PNEUMARM_PARTS_ARMS       names divided by blanks, "virtual:joints=2,seed=1 ... seed=3" by default
PNEUMARM_PARTS_SEEDS      of the trainings, "0,1"
PNEUMARM_PARTS_VARIANTS   names divided by commas; all by default
PNEUMARM_PARTS_MINUTES    of an arm's time that it is recorded for, 20
PNEUMARM_PARTS_MOVEMENTS  of each agent, 100
PNEUMARM_PARTS_FOLDER     where rows and agents are kept; a call with the same folder goes on where another ended.
                          runs/parts by default
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import t as student

from benchmarks import _environment as environment
from benchmarks._trials import Rows, names_of
from benchmarks.agents import prepared, store_of
from benchmarks.baselines import greedy_movements
from pneumarm.learning import AnyAgent, PolicyAgent, PolicySettings, test, train
from pneumarm.learning.planned.agent import PlanAgent
from pneumarm.learning.policy.courses import missed
from pneumarm.planning.search import PlanSettings
from pneumarm.simulation import SINGLE_STEPS
from pneumarm.task.movements import of_rows

ARMS = " ".join(f"virtual:joints=2,seed={seed}" for seed in (1, 2, 3))
TESTS = 1_000
"""Movements in the simulation, without lookahead."""
USUAL = "as it is"


@dataclass(frozen=True)
class Variant:
    """An agent that differs from the usual one."""

    training: Mapping[str, Any] = field(default_factory=dict)
    """Settings that it was trained with."""
    acting: Mapping[str, Any] = field(default_factory=dict)
    """Settings that it acts by."""
    fit: Mapping[str, Any] = field(default_factory=dict)
    """Settings that its simulation was fitted with."""
    share: float = 1.0
    """Of the recording that it was made from."""
    learns: bool = True
    """Whether there is a policy, or plans alone."""


VARIANTS: Mapping[str, Variant] = {
    USUAL: Variant(),
    "decided joint by joint": Variant(acting={"nodes": 0}),
    "no lookahead": Variant(acting={"lookahead": 0}),
    "plans alone": Variant(learns=False),
    "half of the updates": Variant(training={"practice": 1}),
    "16 hidden units": Variant(training={"hidden": (16, 16)}),
    "64 hidden units": Variant(training={"hidden": (64, 64)}),
    "the whole noise": Variant(training={"noise_share": 1.0}),
    "simulation of one layer": Variant(fit={"layers": 1}),
    "no squashed errors": Variant(training={"squash": ()}),
    "half of the recording": Variant(share=0.5),
    "a quarter of the recording": Variant(share=0.25),
}
HEADER = (
    f"{'':28}{'agents':>7}{'in simulation':>15}{'on the arm':>12}{'difference':>17}{'lowest':>9}{'success':>9}"
    f"{'p99':>9}"
)


def measure() -> Iterator[str]:
    folder = environment.folder("PNEUMARM_PARTS_FOLDER", "runs/parts")
    arms = names_of(environment.text("PNEUMARM_PARTS_ARMS", ARMS), "virtual:joints=2,seed=")
    seeds = environment.seeds("PNEUMARM_PARTS_SEEDS", "0,1")
    names = environment.words("PNEUMARM_PARTS_VARIANTS", ",".join(VARIANTS))
    minutes = environment.whole("PNEUMARM_PARTS_MINUTES", 20)
    movements = environment.whole("PNEUMARM_PARTS_MOVEMENTS", 100)
    rows = Rows(folder / "rows.jsonl", "arm", "seed", "variant", "minutes", "movements")
    found: dict[str, list[dict[str, Any]]] = {name: [] for name in names}
    for arm in arms:
        for seed in seeds:
            for name in names:
                row = rows.get(arm, seed, name, minutes, movements)
                if row is None:
                    row = rows.add(trial(folder, arm, seed, name, minutes, movements))
                    yield f"{arm}, seed {seed}, {name}: {np.mean(row['reward']):.1f}"
                found[name].append(row)
    yield HEADER
    for name, each in found.items():
        yield line(name, each, found.get(USUAL, each))


def trial(folder: Path, arm: str, seed: int, name: str, minutes: int, movements: int) -> dict[str, Any]:
    """Return what an agent does on an arm."""
    variant = VARIANTS[name]
    goals = prepared(folder, arm, minutes)[0].goals
    place = folder if variant.share == 1 else folder / f"share-{variant.share:g}"
    place /= "".join(f"{key}-{value}" for key, value in variant.fit.items())
    place.mkdir(exist_ok=True)
    simulation, begin = prepared(place, arm, variant.share * minutes, replace(SINGLE_STEPS, **variant.fit))
    usual = PolicySettings()
    plan = PlanSettings(nodes=usual.nodes, failure_cost=missed(usual.reward))
    agent: AnyAgent = PlanAgent(simulation, plan=plan)
    if variant.learns:
        trained = "".join(f"-{key}-{value}" for key, value in variant.training.items())
        file = place / f"{store_of(place, arm).stem}-{seed}{trained}.agent"
        if not file.exists():
            train(simulation, begin, PolicySettings(**variant.training), seed).agent.save(file)
        kept = PolicyAgent.load(file)
        agent = replace(kept, settings=replace(kept.settings, **variant.acting))
    tested = test(agent, simulation, begin, TESTS if variant.learns else TESTS // 10)
    made, p99 = greedy_movements(agent, arm, goals, movements)
    result = of_rows((one.row() for one in made), simulation.spec.joints)
    return {
        "arm": arm, "seed": seed, "variant": name, "minutes": minutes, "movements": movements,
        "simulated": float(tested.reward.mean()), "reward": result.reward.tolist(),
        "success": float(result.success.mean()), "p99_ms": p99,
    }  # fmt: skip


def line(name: str, each: list[dict[str, Any]], usual: list[dict[str, Any]]) -> str:
    """Return the figures of ``each`` agent of a variant beside those of the ``usual`` ones."""
    means = [np.mean(row["reward"]) for row in each]
    lost = np.array(
        [np.mean(np.subtract(row["reward"], other["reward"])) for row, other in zip(each, usual, strict=True)]
    )
    success, slowest = np.mean([row["success"] for row in each]), max(row["p99_ms"] for row in each)
    told = ""
    if each is not usual:
        half = student.ppf(0.975, len(lost) - 1) * lost.std(ddof=1) / np.sqrt(len(lost)) if len(lost) > 1 else np.nan
        told = f"{lost.mean():+.1f} ± {half:.1f}"
    return (
        f"{name:28}{len(each):7d}{np.mean([row['simulated'] for row in each]):15.1f}{np.mean(means):12.1f}{told:>17}"
        f"{min(means):9.1f}{success:9.4f}{slowest:6.1f} ms"
    )
