"""What adapting gains a policy: development arms that have changed since it was trained, and one that has not.

Every transfer is made twice, adapting and not, with the same arm, goals and begin states: arms warm up and creep, so
the reward after is compared with that of the agent which stayed as it was, not with the reward before. Goals within
the reach are those between the lowest and the highest angle of all movements; no agent reaches the others. Settings
come from the environment:

PNEUMARM_ADAPTATION_ARMS       seeds of virtual arms, "1,2,3,4,5" by default; the judging arms are 1001 to 1010
PNEUMARM_ADAPTATION_CHANGES    names from CHANGES; all by default
PNEUMARM_ADAPTATION_MOVEMENTS  movements while learning, 300
PNEUMARM_ADAPTATION_TESTS      movements before and after, 200
PNEUMARM_ADAPTATION_SEED       added to the seeds of begin states and goals, 0
PNEUMARM_ADAPTATION_FOLDER     where stores, simulations and agents are kept; a temporary folder by default
"""

import os
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.agents import prepared
from pneumarm.arm import guarded
from pneumarm.arm.virtual import ArmParameters, VirtualArm, draw_parameters
from pneumarm.arm.virtual.parameters import JointParameters, MuscleParameters
from pneumarm.control import BEGIN, Episode, Transferred, TransferSettings, transfer
from pneumarm.learning import AnyAgent, load_agent, train
from pneumarm.transitions import Store

NIGHT = 14 * 3600.0
"""A rest [s] of a rested arm."""
WORN_IN = 600
"""Begin states that a rested arm was brought to before, in about three quarters of an hour."""
HEADER = (
    f"{'arm':5}{'change':11}{'before':>8}{'last 100':>9}{'after':>8}{'unadapted':>10}{'gain':>15}"
    f"{'in reach':>10}{'after':>8}{'unadapted':>10}{'success':>8}{'unadapted':>10}{'accepted':>9}{'s':>5}"
)


def each_joint(parameters: ArmParameters, change: Callable[[JointParameters], JointParameters]) -> ArmParameters:
    return replace(parameters, joints=tuple(change(joint) for joint in parameters.joints))


def each_muscle(joint: JointParameters, change: Callable[[MuscleParameters], MuscleParameters]) -> JointParameters:
    first, second = joint.muscles
    return replace(joint, muscles=(change(first), change(second)))


def heavier(parameters: ArmParameters, arm: int) -> ArmParameters:
    """A payload 30 % heavier."""
    return each_joint(parameters, lambda joint: replace(joint, mass=1.3 * joint.mass))


def exchanged(parameters: ArmParameters, arm: int) -> ArmParameters:
    """Muscle 1 is that of another draw."""
    other = draw_parameters(100 + arm).joints[0].muscles[0]
    return each_joint(parameters, lambda joint: replace(joint, muscles=(other, joint.muscles[1])))


def leaking(parameters: ArmParameters, arm: int) -> ArmParameters:
    """Muscles leak three times as much."""
    return each_joint(
        parameters, lambda joint: each_muscle(joint, lambda muscle: replace(muscle, leak=3 * muscle.leak))
    )


def same(parameters: ArmParameters, arm: int) -> ArmParameters:
    return parameters


CHANGES = {"unchanged": same, "payload": heavier, "muscle": exchanged, "leak": leaking, "rested": same}


def measure() -> Iterator[str]:
    arms = os.environ.get("PNEUMARM_ADAPTATION_ARMS", "1,2,3,4,5").split(",")
    changes = os.environ.get("PNEUMARM_ADAPTATION_CHANGES", ",".join(CHANGES)).split(",")
    settings = TransferSettings(
        episodes=int(os.environ.get("PNEUMARM_ADAPTATION_MOVEMENTS", "300")),
        test_episodes=int(os.environ.get("PNEUMARM_ADAPTATION_TESTS", "200")),
    )
    gains: dict[str, list[tuple[float, float]]] = {change: [] for change in changes}
    yield HEADER
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(os.environ.get("PNEUMARM_ADAPTATION_FOLDER", temporary))
        folder.mkdir(exist_ok=True)
        for arm in map(int, arms):
            agent = trained(folder, arm)
            for change in changes:
                line, gain = adapted(agent, arm, change, settings)
                gains[change].append(gain)
                yield line
    for change, found in gains.items():
        gain, reached = np.mean(found, axis=0)
        lowest = min(one[0] for one in found)
        yield f"{change}: gain {gain:+.2f} (of an arm at least {lowest:+.2f}), on goals within reach {reached:+.2f}"


def trained(folder: Path, arm: int) -> AnyAgent:
    """Return the policy trained for a virtual arm; train it where that is not done yet."""
    file = folder / f"{arm}.agent"
    if not file.exists():
        train(*prepared(folder, arm), None, 1).agent.save(file)
    return load_agent(file)


def adapted(agent: AnyAgent, arm: int, change: str, settings: TransferSettings) -> tuple[str, tuple[float, float]]:
    """Return a line of the table, and the gains of reward on all goals and on those within the reach."""
    began = time.perf_counter()
    moved, low, high = moved_on(agent, arm, change, settings)
    seconds = time.perf_counter() - began
    fixed, lowest, highest = moved_on(agent, arm, change, replace(settings, learning_rate=0.0))
    low, high = np.minimum(low, lowest), np.maximum(high, highest)
    before, last, after, unadapted = (
        rewards(phase)
        for phase in (
            moved.phase("before"),
            moved.phase("learning")[-100:],
            moved.phase("after"),
            fixed.phase("after"),
        )
    )
    inside = np.array([bool(np.all((low <= one.goal) & (one.goal <= high))) for one in moved.phase("after")])
    gained = after - unadapted
    spread = 1.96 * gained.std() / np.sqrt(len(gained))
    rates = [np.mean([one.success for one in transferred.phase("after")]) for transferred in (moved, fixed)]
    line = (
        f"{arm:<5}{change:11}{before.mean():8.2f}{last.mean():9.2f}{after.mean():8.2f}{unadapted.mean():10.2f}"
        f"{f'{gained.mean():+.2f} ± {spread:.2f}':>15}{inside.mean():10.1%}{after[inside].mean():8.2f}"
        f"{unadapted[inside].mean():10.2f}{rates[0]:8.3f}{rates[1]:10.3f}{moved.adaptations:9d}{seconds:5.0f}"
    )
    return line, (float(gained.mean()), float(gained[inside].mean()))


def moved_on(
    agent: AnyAgent, arm: int, change: str, settings: TransferSettings
) -> tuple[Transferred, NDArray[np.float64], NDArray[np.float64]]:
    """Return a transfer onto the changed arm, and the lowest and highest angles of all its movements."""
    opened = VirtualArm(CHANGES[change](draw_parameters(arm), arm), seed=2000 + arm)
    if change == "rested":
        random = np.random.default_rng(arm)
        for _ in range(WORN_IN):
            BEGIN.reach(guarded(opened), random)
        opened.rest(NIGHT)
    with tempfile.TemporaryDirectory() as place, Store.for_arm(Path(place) / "db", opened.spec) as store:
        moved = transfer(
            agent, opened, store, settings, seed=arm + int(os.environ.get("PNEUMARM_ADAPTATION_SEED", "0"))
        )
        angles = np.concatenate([rows.angle for rows in store.blocks()])
    return moved, angles.min(axis=0), angles.max(axis=0)


def rewards(episodes: list[Episode]) -> NDArray[np.float64]:
    return np.array([one.reward for one in episodes])
