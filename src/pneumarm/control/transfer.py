"""Transfer: an agent moves onto an arm, is tested, goes on learning there, and is tested again (thesis 5.5)."""

import json
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from pneumarm.adaptation import AdaptationSettings, adaptation
from pneumarm.arm import Arm, ControlCycle, guarded
from pneumarm.arm.counts import Counts
from pneumarm.control.agent import AgentController, warm_up
from pneumarm.control.found import Found
from pneumarm.control.monitor import Monitor
from pneumarm.control.movement import BEGIN, MOVEMENT, draw_movement, move
from pneumarm.control.versions import Adapted, save_history, version_keeper
from pneumarm.errors import ArmFailure, PneumarmError, UnusableInput
from pneumarm.files import require_folder
from pneumarm.learning import AnyAgent, fingerprint
from pneumarm.settings import Settings, Valid
from pneumarm.task.movements import Movement, Movements, of_rows, write_episodes
from pneumarm.transitions import Store
from pneumarm.transitions.rows import Recorded, joined, rows_of
from pneumarm.transitions.store import SequenceEntry
from pneumarm.transitions.watch import keep_watch
from pneumarm.transitions.watch import warm_up as warm_up_watch

Phase = Literal["before", "learning", "after"]
PHASES: tuple[Phase, ...] = ("before", "learning", "after")
_TOGETHER = 10
"""Movements that are stored in one transaction: at most these are made again after an interruption."""


@dataclass(frozen=True)
class TransferSettings(Settings):
    """How an agent is tested and adapted on an arm."""

    episodes: int = 1500
    """Movements while learning (thesis section 5.5.1: progress is seen after some 750)."""
    learning_rate: float = 0.01
    """Learning rate on the arm (thesis section 5.5.1: 0, 0.05 and 0.10 were compared)."""
    test_episodes: int = 500
    """Greedy movements before and again after learning; at least 500 for figures to be compared."""
    averaged: float = 0.5
    """Share of the movements while learning, the last ones, over which the adapted agent's weights are averaged.

    A difference from the thesis, which keeps the last weights (0 does): with a constant learning rate they go on
    fluctuating, and where they happen to stand at the end decides how good the agent is (B. T. Polyak and
    A. B. Juditsky, "Acceleration of stochastic approximation by averaging", SIAM J. Control Optim. 30, 1992)."""
    adaptation: AdaptationSettings = field(default_factory=AdaptationSettings)
    """How a policy adapts between movements; with a learning rate of 0 it does not."""
    close_while_computing: bool = False
    """Close the valves between reading and acting (thesis figure 2.8: left as they are)."""

    def _valid(self) -> Valid:
        return {
            "episodes": self.episodes >= 0 or "0 or more",
            "learning_rate": 0 <= self.learning_rate <= 1 or "0 to 1",
            "test_episodes": self.test_episodes >= 1 or "1 or more",
            "averaged": 0 <= self.averaged <= 1 or "0 to 1",
        }

    def movements(self, phase: Phase) -> int:
        """Number of movements in ``phase``."""
        return self.episodes if phase == "learning" else self.test_episodes


@dataclass(frozen=True)
class Transferred:
    """What came of a transfer."""

    movements: dict[str, Movements]
    """Those of each phase in order."""
    agent: AnyAgent
    """The agent as it is after learning."""
    learning_rate: float
    adapted: Adapted | None = None
    """How a policy adapted; None for an agent that does not, or learns while it moves."""
    found: Found = field(default_factory=Found)
    """What the monitor found wrong with the arm, and what guard, control cycle and link counted in each phase."""

    @property
    def adaptations(self) -> int:
        """How often a policy has adapted."""
        return 0 if self.adapted is None else sum(e.what == "accepted" for e in self.adapted.events)

    def results(self) -> dict[str, Any]:
        """Return the figures before and after learning, as in ``results.json``."""
        return {
            "before": self.movements["before"].results(),
            "after": self.movements["after"].results(),
            "episodes": self.movements["learning"].n,
            "learning_rate": self.learning_rate,
            "adaptations": self.adaptations,
            **self.found.results(),
            **({} if self.adapted is None else self._adapted(self.adapted)),
        }

    @staticmethod
    def _adapted(adapted: Adapted) -> dict[str, Any]:
        """Return when the arm was found to have changed, and what became of the agent."""
        return {
            "version": adapted.version,
            "noticed": [e.movement for e in adapted.events if e.what == "noticed"],
            "rolled_back": [e.movement for e in adapted.events if e.what == "rolled back"],
        }


def transfer(
    agent: AnyAgent,
    arm: Arm,
    store: Store,
    settings: TransferSettings = TransferSettings(),
    *,
    seed: int = 0,
    progress: Callable[[float, float], None] | None = None,
    keep_version: Callable[[int, AnyAgent], None] | None = None,
    watch: Monitor | None = None,
) -> Transferred:
    """Test ``agent`` on ``arm``, let it learn there, test it again; every movement goes into ``store``.

    ``keep_version`` is told the number of each version of an adapting agent and the agent itself, as soon as there is
    one; after an interruption it may be told of the same one again.

    A transfer that was interrupted goes on after the last movement that was stored, on an arm that can be put into
    a saved state as if nothing had happened. What ``watch`` finds spoiled, by default a :class:`Monitor` with the
    agent's simulation, is stored but not learned from; it counts in the figures, because it happened. It goes on with
    the simulation of an adapted agent: an arm that has changed is not complained of once it is adapted to.

    Raises:
        UnusableInput: arm and agent do not fit, or the store holds a transfer with other settings.
        ArmFailure: the arm failed; the movements up to then are stored.

    """
    check_fit(agent, arm)
    number = store.resume_run("transfer", {**asdict(settings), "seed": seed, "agent": fingerprint(agent)})
    done = [dict(entry.info) for entry in _movements(store, number)]
    squares = [info[_SQUARES] for info in done if _SQUARES in info]
    arm_state = store.state("arm")
    if arm_state is not None and arm.get_state() is not None:
        arm.set_state(arm_state)
    rate = settings.learning_rate if agent.learns else 0.0
    learner = agent.actor(rate, explores=agent.learns, seed=seed)
    mean = _Mean(agent)
    adapting = adaptation(agent, settings.adaptation, seed)
    adapts = settings.learning_rate > 0
    if done:
        learner.set_state(store.state("learner") or learner.get_state())
        mean.set_state(store.state("mean") or mean.get_state())
        if adapting is not None:
            adapting.set_state(store.state("adaptation") or adapting.get_state())
    elif keep_version is not None and adapting is not None:
        keep_version(0, agent)
    total = sum(settings.movements(phase) for phase in PHASES)
    cycle = ControlCycle(guarded(arm), settings.close_while_computing)
    waiting: list[Recorded] = []
    broken: list[Recorded] = []
    watch = watch or Monitor(arm.spec, getattr(agent, "simulation", None))  # not every kind of agent keeps one
    if adapting is not None:
        watch.judge_by(adapting.agent.simulation)
    warm_up_watch(watch, arm.spec)
    warm_up(agent)
    if agent.learns:
        warm_up(agent, rate, explores=True)
    if done and (seen := store.state("watch")) is not None:
        watch.set_state(seen)
    counted = {phase: Counts.of(saved) for phase, saved in json.loads(store.state(_COUNTS) or b"{}").items()}
    until = Counts.now(cycle)

    def count(phase: Phase) -> None:
        """Count what happened in ``phase`` since it was last counted."""
        nonlocal until
        before, until = until, Counts.now(cycle)
        counted[phase] = counted.get(phase, Counts()) + (until - before)

    def keep() -> None:
        state = {"learner": learner.get_state(), "mean": mean.get_state(), "arm": arm.get_state()}
        state["watch"] = watch.get_state()
        state[_COUNTS] = json.dumps({phase: counts.as_dict() for phase, counts in counted.items()}).encode()
        keep_watch(store, watch, number)
        if adapting is not None:
            state["adaptation"] = adapting.get_state()
        recorded = [replace(one, marks=(*watch.marks(one), *one.marks)) for one in waiting]
        store.append_all(recorded, {name: value for name, value in state.items() if value is not None})
        waiting.clear()

    def keep_rest() -> None:
        """Keep what waits, and nothing twice: a signal may have come between keeping and forgetting it."""
        kept = max(len(waiting) - (len(done) - len(_movements(store, number))), 0)
        waiting[:] = [*waiting[kept:], *broken]
        if waiting:
            keep()

    def note(phase: Phase, movement: Movement) -> None:
        """Keep what came of a movement, and let the agent take notice of it."""
        info = {_PHASE: phase, **movement.row()}
        if adapting is not None:
            judges, sound = adapts and phase == "learning", not watch.marks(movement.recorded)
            squares.append(adapting.saw(rows_of(movement.recorded), movement.reward, judges=judges, sound=sound))
            info[_SQUARES] = squares[-1]
            watch.judge_by(adapting.agent.simulation)
        done.append(info)
        waiting.append(replace(movement.recorded, info=info))

    def adapt() -> None:
        """Let the agent adapt where that is due."""
        if adapting is None or not adapts or not adapting.is_due():
            return
        keep()  # it learns from what is stored, so that an interruption changes nothing
        made = [entry.number for entry in _movements(store, number)][-adapting.usable :]
        blocks = list(store.blocks(sequences=lambda numbers: np.isin(numbers, made)))
        if blocks and adapting.learn(joined(blocks)):
            watch.judge_by(adapting.agent.simulation)
            if keep_version is not None:
                keep_version(adapting.version, adapting.agent)

    def shown() -> AnyAgent:
        if adapting is not None:
            return adapting.agent
        return mean.agent if mean.count else agent.with_weights(learner.weights())

    phase: Phase = PHASES[0]
    try:
        for phase in PHASES:
            movements = settings.movements(phase)
            greedy = phase != "learning"
            made = sum(info[_PHASE] == phase for info in done)
            if phase == "after" and settings.episodes > 0 and made == 0:
                adapt()
            learns = adapting is None and not greedy
            moving = agent if learns else shown()
            controller = AgentController(moving, learner if learns else None)
            for i in range(made, movements):
                if phase == "learning":
                    adapt()
                if adapting is not None and moving is not adapting.agent:
                    moving = adapting.agent
                    controller = AgentController(moving)
                draw = draw_movement(agent.goal_range, seed, greedy, i)
                BEGIN.reach(cycle.arm, draw.random)
                movement = move(
                    cycle, controller, draw.goal, agent.settings, watch, broken.append, agent.window.velocity
                )
                if phase == "learning" and agent.learns and i >= (1 - settings.averaged) * movements:
                    mean.add(learner.weights())
                note(phase, movement)
                count(phase)
                if len(waiting) == _TOGETHER or i == movements - 1:
                    keep()
                if progress is not None:
                    progress(len(done), total)
    except BaseException as error:
        if arm.get_state() is None:  # no arm can make these movements again
            with suppress(Exception):  # the first failure is the one to tell of
                count(phase)
                keep_rest()
        if isinstance(error, PneumarmError) or not isinstance(error, Exception):
            raise
        raise ArmFailure(
            f"{arm.spec.name}: failed in movement {len(done) + 1} ({type(error).__name__}: {error}); "
            "see to the arm and run the same command again"
        ) from error
    adapted = None
    if adapting is not None:
        adapted = Adapted(adapting.version, adapting.quantities, np.array(squares), adapting.events)
    found = Found(tuple(watch.findings), store.marked_rows(number), counted)
    phases = {name: [info for info in done if info[_PHASE] == name] for name in PHASES}
    made_in = {str(name): of_rows(rows, agent.window.joints) for name, rows in phases.items()}
    return Transferred(made_in, shown(), rate, adapted, found)


def _movements(store: Store, run: int) -> list[SequenceEntry]:
    """Return the movements of ``run`` that were finished, in order."""
    return [entry for entry in store.catalogue(run) if entry.kind == MOVEMENT]


_PHASE = "phase"  # place of a movement's phase beside its figures in the store
_SQUARES = "squares"  # place of a movement's errors beside its figures in the store
_COUNTS = "counts"  # place of what was counted, among the states in the store


class _Mean:
    """The mean of an agent's weights over movements."""

    def __init__(self, agent: AnyAgent) -> None:
        self._agent = agent
        self._sum = np.zeros(agent.weights().shape)
        self.count = 0

    def add(self, weights: NDArray[np.float32]) -> None:
        self._sum += weights
        self.count += 1

    @property
    def agent(self) -> AnyAgent:
        """The agent with the mean weights."""
        return self._agent.with_weights((self._sum / self.count).astype(np.float32))

    def get_state(self) -> bytes:
        return np.int64(self.count).tobytes() + self._sum.tobytes()

    def set_state(self, state: bytes) -> None:
        self.count = int(np.frombuffer(state[:8], np.int64)[0])
        self._sum = np.frombuffer(state[8:]).reshape(self._sum.shape).copy()


def transfer_into(
    folder: Path,
    agent: AnyAgent,
    arm: Arm,
    settings: TransferSettings = TransferSettings(),
    *,
    seed: int = 0,
    progress: Callable[[float, float], None] | None = None,
) -> dict[str, Any]:
    """Transfer ``agent`` and leave ``episodes.csv``, ``transitions.db`` and the adapted agent in ``folder``.

    Of an agent that adapts between movements its versions and their history stay too, see
    :mod:`~pneumarm.control.versions`.

    Raises:
        UnusableInput: the folder's parent is missing, or it holds another transfer.

    """
    check_fit(agent, arm)
    require_folder(folder)
    folder.mkdir(exist_ok=True)
    with Store.for_arm(folder / "transitions.db", arm.spec) as store:
        moved = transfer(
            agent, arm, store, settings, seed=seed, progress=progress, keep_version=version_keeper(folder)
        )
    moved.agent.save(folder / "adapted.safetensors")
    save_history(folder, moved.adapted)
    write_episodes(folder / "episodes.csv", moved.movements)
    return moved.results()


def check_fit(agent: AnyAgent, arm: Arm) -> None:
    """Raise UnusableInput where ``agent`` was not trained for an arm like this."""
    for name in ("joints", "counts_per_degree", "counts_per_bar", "angle_range", "period"):
        trained, found = getattr(agent.spec, name), getattr(arm.spec, name)
        if not np.allclose(trained, found, rtol=1e-3):
            raise UnusableInput(
                f"this agent was trained for an arm whose {name} is {trained}, that of {arm.spec.name} is {found}"
            )
    agent.window.require(arm.spec.further, arm.spec.name)
