"""Arrays as a run leaves them, made up but of realistic size and shape; every builder takes a seed."""

from dataclasses import replace

import numpy as np

from pneumarm.adaptation import Event
from pneumarm.arm.counts import Counts
from pneumarm.arm.guard import Interventions
from pneumarm.arm.seam import ArmSpec
from pneumarm.control import Adapted, Finding
from pneumarm.control.condition import Condition
from pneumarm.learning import CURVES
from pneumarm.report.data import CoverageData, Demonstration, MarkedData, QualityData, TrainingData, TransferData
from pneumarm.report.figures.baselines import Baseline
from pneumarm.report.sections import RunData
from pneumarm.report.style import of_joint
from pneumarm.statistics import Estimate
from pneumarm.task import Movements
from pneumarm.transitions.window import QUANTITIES, Window


def observations(n, joints, random):
    """Angles, velocities and pressures (n, joints, 4) that hang together as on an antagonistic joint."""
    pressure = 170 * random.beta(1.3, 1.6, (n, joints, 2))
    angle = 512 + 2.4 * (pressure[..., 0] - pressure[..., 1]) + random.normal(0, 18, (n, joints))
    velocity = random.standard_t(3, (n, joints)) * 0.6
    return np.stack([angle, velocity, pressure[..., 0], pressure[..., 1]], axis=2)


def coverage(n=20_000, joints=1, seed=0):
    random = np.random.default_rng(seed)
    counts = random.geometric(0.09, 5200 if n else 0)
    grown = np.linspace(n / 20, n, 20)
    growth = np.stack([grown, 5200 * (1 - np.exp(-grown / (0.3 * max(n, 1))))], axis=1).astype(np.int64)
    return CoverageData(
        observation=observations(n, joints, random),
        cells_holding=np.bincount(counts, minlength=1),
        cells=36_864**joints,
        per_cell=5,
        growth=growth if n else np.empty((0, 2), np.int64),
    )


def quality(n=12_000, joints=1, seed=0, steps=30, continuous=False):
    random = np.random.default_rng(seed)
    now = observations(n, joints, random)
    valves = random.uniform(-1, 1, (n, joints, 2)) if continuous else random.integers(-1, 2, (n, joints, 2))
    change = np.stack(
        [
            33 * now[..., 1] + 6 * (valves[..., 0] - valves[..., 1]),
            0.1 * (valves[..., 0] - valves[..., 1]) - 0.3 * now[..., 1],
            9 * valves[..., 0] - 0.02 * now[..., 2],
            9 * valves[..., 1] - 0.02 * now[..., 3],
        ],
        axis=2,
    )
    spread = np.array([2.0, 0.1, 1.0, 0.9]) * (1 + 0.8 * np.abs(now[..., 1:2]))
    target = now + change + random.normal(0, 1, now.shape) * spread
    k = np.arange(1, steps + 1).reshape(-1, 1, 1)
    window = Window(joints=joints)
    names = window.input_names()
    outputs = [f"{QUANTITIES[i]}{of_joint(j, joints)}" for j in range(joints) for i in (0, 2, 3)]
    weights = random.laplace(0, 0.15, (len(names), len(outputs)))
    return QualityData(
        observation=now,
        target=target,
        predicted=now + 0.97 * change,
        command=valves,
        time=np.sort(random.uniform(0, 6600, n)),
        propagation=np.array([3.4, 0.15, 1.4, 1.2]) * np.repeat(k, joints, axis=1) ** 0.62,
        weights=weights,
        inputs=names,
        outputs=outputs,
    )


def training(agents=16, evaluations=44, seed=0):
    random = np.random.default_rng(seed)
    deviation = np.empty((agents, evaluations))
    performance = np.empty((agents, evaluations))
    evaluated = random.integers(max(1, evaluations * 2 // 3), evaluations + 1, agents)
    for a in range(agents):
        now = 60.0
        for e in range(evaluations):
            deviation[a, e] = now
            asked = 0.5 + 0.45 * (now - 60) / 740
            performance[a, e] = np.clip(asked + random.normal(0.03, 0.05), 0, 1)
            now = min(800.0, now * 1.1) if performance[a, e] > asked else now * 0.97
    share = (deviation - 60) / 740
    reward = 9.5 - random.exponential(2.5, agents)
    episodes = np.tile(500.0 * np.arange(1, evaluations + 1), (agents, 1))
    curves = (episodes, deviation, 0.5 + 0.45 * share, performance, 0.5 - 0.45 * share, 20 - 19 * share)
    return TrainingData(
        curves=np.stack(curves, axis=2),
        columns=CURVES,
        evaluated=evaluated,
        reward=reward,
        success=np.clip(1 - random.exponential(0.004, agents), 0, 1),
        chosen=int(np.argmax(reward)),
    )


def episodes(n, joints=1, seed=0, begin=0.0, on_arm=True, success=0.98, extra=0.0):
    """``n`` episodes whose length grows with the displacement; ``extra`` actions and switches in the mean."""
    random = np.random.default_rng(seed)
    start, goal = random.uniform(150, 870, (2, n, joints))
    distance = np.abs(goal - start).max(axis=1, initial=0)
    won = random.random(n) < success
    actions = np.where(won, 1 + random.poisson(6 + distance / 40 + extra), 100)
    switches = np.minimum(random.poisson(2.5 + extra / 2, n), actions - 1)
    reward = 50.0 * won - actions + won - 8 * switches
    seconds = actions / 30
    ends = begin + np.cumsum(seconds + 3.75)
    return Movements(
        goal=goal,
        angle_begin=start,
        angle_end=goal,
        velocity_end=np.zeros_like(goal),
        actions=actions,
        switches=switches[:, None],
        reward=reward,
        success=won,
        time_start=np.round(ends - seconds, 4) if on_arm else np.zeros(n),
        time_end=np.round(ends, 4) if on_arm else np.zeros(n),
    )


def transfer(joints=1, counts=(500, 1500, 500), seed=0):
    phases, begin = [], 7200.0
    for i, (n, success, extra) in enumerate(zip(counts, (0.96, 0.97, 0.99), (4, 2, 1), strict=True)):
        phases.append(episodes(n, joints, seed + i, begin, success=success, extra=extra))
        begin = phases[-1].time_end[-1] if n else begin
    return TransferData(*phases, learning_rate=0.05)


def adaptation(movements=300, joints=1, seed=0):
    random = np.random.default_rng(seed)
    of = [""] + [f" of joint {joint + 1}" for joint in range(1, joints)]
    quantities = [name + which for which in of for name in ("angle", "pressure_1", "pressure_2")]
    squares = np.round(random.gamma(3.0, 1 / 3, (movements, 2, len(quantities))), 4)
    squares[40:, 0] *= 4
    squares[40:60, 1] *= 4
    ratios = [2.0] * len(quantities)
    events = [
        Event("noticed", 46, 0, {"since": 40, "ratio": ratios}),
        Event("refused", 50, 0, {"movements": 10, "before": ratios, "after": ratios}),
        Event("accepted", 60, 1, {"movements": 20, "before": ratios, "after": [1.0] * len(quantities)}),
        Event("rolled back", 100, 0, {"taken_back": 1, "reward_before": 38.0, "reward_after": 31.0}),
    ]
    return Adapted(0, quantities, squares, [event for event in events if event.movement <= movements])


def movement(name="large displacement", goal=70.0, joints=1, n=45, reached=True):
    spec = ArmSpec(joints=joints)
    t = 7300 + np.arange(n) / 30
    x = np.minimum(np.arange(n) / 22, 1)
    path = 10 * x**3 - 15 * x**4 + 6 * x**5
    ringing = np.where(x >= 1, 2 * np.exp(-(np.arange(n) - 22) / 8) * np.sin((np.arange(n) - 22) / 2), 0)
    angle = 512 + spec.counts_per_degree * (-30 + goal * path + ringing)
    pressure = spec.counts_per_bar * np.stack([0.3 + 0.5 * path, 0.7 - 0.45 * path], axis=1)
    valves = np.zeros((n, joints, 2))
    valves[:14, :, 0], valves[:9, :, 1], valves[14:20, :, 1] = 1, -1, 1
    return Demonstration(
        time=t,
        angle=np.repeat(angle[:, None], joints, axis=1),
        pressure=np.repeat(pressure[:, None], joints, axis=1),
        valves=valves,
        goal=np.full(joints, 512 + spec.counts_per_degree * (goal - 30)),
        end=float(t[min(22, n - 1)]) if reached else None,
        name=name,
    )


def marked(stretches=40, reasons=("stuck valve: joint 1, muscle 2 (the inlet is stuck closed)", "low supply")):
    """Stretches of 100 rows here and there among 200,000 rows of collecting and 50,000 of moving."""
    random = np.random.default_rng(1)
    first = np.sort(random.choice(2_400, stretches, replace=False)) * 100
    return MarkedData(
        spans=np.stack([first, first + 100], axis=1),
        reason=np.arange(stretches) % max(len(reasons), 1),
        ends=np.array([200_000, 250_000]),
        reasons=reasons,
        stages=("collect", "transfer"),
    )


FOUND = Finding("stuck-valve", "the inlet is stuck closed", 1, 2, since=59.5, noticed=60.4, until=82.6)
LEFT = Finding("low-supply", "the supply is gone", None, None, since=602.7, noticed=602.9)


def found(*findings, late=0, missed=0, link=None, phases=("collecting",)):
    """What was wrong, as a stage's results hold it."""
    counts = Counts(Interventions(pressure=30, late=late, vented=late // 2), missed, link or {})
    marked = {str(replace(one, until=None)): 474 for one in findings}
    return Condition(findings, marked, dict.fromkeys(phases, counts)).results()


def results():
    moving = found(LEFT, late=3, missed=7, link={"requests": 9_000, "retries": 4}, phases=("before", "after"))
    return {
        "collect": {"transitions": 200_000, "seconds": 7350.0, **found(FOUND)},
        "filter": {"kept": 21_900, "cells_occupied": 5200},
        "simulation": {
            "std": {"angle": 3.31, "velocity": 0.12, "pressure_1": 1.44, "pressure_2": 1.38},
            "seconds": 1.9,
        },
        "training": {"episodes": 280_000, "steps": 9_000_000, "seconds": 4.2, "steps_per_second": 2.1e6},
        "test": {"lookahead": tested(37.4)},
        "transfer": {"learning_rate": 0.05, **moving},
        "bound": {
            "open_loop": tested(40.2),
            "closed_loop": tested(39.9),
            "distance": {
                phase: {"open_loop": below(40.2, 2.1), "closed_loop": below(39.9, 1.8)}
                for phase in ("before", "after")
            },
        },
    }


def tested(reward):
    means = {"reward": reward, "success_rate": 0.998, "actions": 8.9, "switches": 0.31}
    return {"episodes": 500, **means, "intervals": {name: [0.99 * v, 1.002 * v] for name, v in means.items()}}


def below(planned, by):
    return {"episodes": 150, "planned": planned, "reward": by, "interval": [by - 0.5, by + 0.5]}


def baselines(agents=3, seed=0):
    """Methods that were trained, each with some agents, and levels that need no training."""
    random = np.random.default_rng(seed)
    trained = []
    for name, seconds, reward in (("policy", 4.0, 38.0), ("sarsa", 2.0, 21.0), ("ppo", 60.0, 35.0))[: agents and 3]:
        means = reward + random.normal(0, 2, agents)
        spent = seconds * random.uniform(0.8, 1.2, agents)
        mean = Estimate(float(means.mean()), float(means.mean()) - 0.6, float(means.mean()) + 0.6, 500 * agents)
        trained.append(Baseline(name, spent, means, mean))
    return trained, {"open loop": Estimate(40.2, 39.6, 40.8, 500), "planning": Estimate(38.8, 38.0, 39.6, 500)}


def run(joints=1, small=False):
    """A whole run; a ``small`` one is drawn faster."""
    part = 20 if small else 1
    name = "virtual" if joints == 1 else "two joints"
    return RunData(
        spec=ArmSpec(joints=joints, name=name),
        results=results(),
        coverage=coverage(20_000 // part, joints),
        quality=quality(12_000 // part, joints),
        training=training(),
        test=episodes(10_000 // part, joints, on_arm=False, success=0.995),
        transfer=transfer(joints, (500 // part, 1500 // part, 500 // part)),
        adaptation=adaptation(2500 // part, joints),
        demonstrations=(
            movement("large displacement", 70.0, joints),
            movement("typical displacement", 30.0, joints),
            movement("small displacement", -5.0, joints, reached=False),
        ),
        marked=marked(),
    )
