"""Transfer: an agent moves onto an arm, is tested, goes on learning there, and is tested again (thesis 5.5)."""

import json
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from pneumarm.adaptation import COMPARED, AdaptationSettings, adaptation_of
from pneumarm.arm import Arm, ControlCycle, Controller, guarded
from pneumarm.arm.counts import Counts
from pneumarm.arm.seam import check_pressures
from pneumarm.control.agent import AgentController, controller_of, warm_up
from pneumarm.control.condition import Condition
from pneumarm.control.monitor import Mode, Monitor
from pneumarm.control.movement import BEGIN, MOVEMENT, draw_movement, move
from pneumarm.control.versions import ADAPTED, Adapted, save_history, version_keeper
from pneumarm.errors import ArmFailure, PneumarmError, UnusableInput
from pneumarm.files import make_folder
from pneumarm.learning import AnyAgent, Knows, LearningActor, Learns, SimulationAgent, fingerprint, goals_of
from pneumarm.moving.settling import settled_at
from pneumarm.settings import NonNegativeInt, PositiveInt, PythonOnly, Settings, Share
from pneumarm.task.movements import Movement, Movements, of_rows, write_episodes
from pneumarm.transitions import KINDS, Store
from pneumarm.transitions.rows import Recorded, join_rows, rows_of
from pneumarm.transitions.store import SequenceEntry
from pneumarm.transitions.watch import Patience, keep_watch, warm_up_watch

Phase = Literal["before", "learning", "after"]
PHASES: tuple[Phase, ...] = ("before", "learning", "after")
_TOGETHER = 10
"""Movements that are stored in one transaction, at most those that are made again after an interruption; of an arm
that cannot make them again every one is stored at once."""


@dataclass(frozen=True)
class TransferSettings(Settings):
    """How an agent is tested and adapted on an arm."""

    episodes: NonNegativeInt = 1500
    """Movements while learning (thesis section 5.5.1: progress is seen after some 750)."""
    learning_rate: Share = 0.01
    """Learning rate on the arm (thesis section 5.5.1: 0, 0.05 and 0.10 were compared)."""
    test_episodes: PositiveInt = 500
    """Greedy movements before and again after learning; at least 500 for figures to be compared."""
    averaged: Share = 0.5
    """Share of the movements while learning, the last ones, over which the adapted agent's weights are averaged.

    A difference from the thesis, which keeps the last weights (0 does): with a constant learning rate they go on
    fluctuating, and where they happen to stand at the end decides how good the agent is (B. T. Polyak and
    A. B. Juditsky, "Acceleration of stochastic approximation by averaging", SIAM J. Control Optim. 30, 1992)."""
    hold: Annotated[float, Meta(ge=0, le=3600)] = 2.0
    """For how long an agent that settles and holds has each goal, from when it is given [s].

    The movement is counted up to where the goal is reached, and the agent adapts to all of it."""
    adaptation: AdaptationSettings = field(default_factory=AdaptationSettings)
    """How a policy adapts between movements; with a learning rate of 0 it does not."""
    close_while_computing: Annotated[bool, PythonOnly] = False
    """Close the valves between reading and acting (thesis figure 2.8: left as they are)."""

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
    condition: Condition = field(default_factory=Condition)
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
            **self.condition.results(),
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
    agent's simulation, is stored but not learned from; it counts in the figures, because it happened. Where that
    lasts the transfer stops, as collecting does, and a call after the arm was seen to goes on. The monitor goes on
    with the simulation of an adapted agent: an arm that has changed is not complained of once it is adapted to.

    Raises:
        UnusableInput: arm and agent do not fit, or the store holds a transfer with other settings.
        ArmFailure: the arm failed, or something has been wrong for several movements; those up to then are stored.

    """
    return Transfer(agent, arm, store, settings, seed, keep_version, watch).run(progress)


def monitor_of(agent: AnyAgent, arm: Arm, mode: Mode = "stop") -> Monitor:
    """Return the monitor of ``arm`` while ``agent`` moves it, judging by its simulation if it has one."""
    return Monitor(arm.spec, agent.simulation if isinstance(agent, SimulationAgent) else None, mode=mode)


class Transfer:
    """A transfer, see :func:`transfer`; where the store holds the begin of it, it goes on from there."""

    def __init__(
        self,
        agent: AnyAgent,
        arm: Arm,
        store: Store,
        settings: TransferSettings,
        seed: int = 0,
        keep_version: Callable[[int, AnyAgent], None] | None = None,
        watch: Monitor | None = None,
    ) -> None:
        check_fit(agent, arm)
        self._arrived, self._store, self._settings, self._seed = agent, store, settings, seed
        self._arm = guarded(arm)
        self._keep_version = keep_version or (lambda version, agent: None)
        self._number = store.resume_run("transfer", {**asdict(settings), "seed": seed, "agent": fingerprint(agent)})
        self._done = [dict(entry.info) for entry in self._stored()]
        """What is stored beside each movement: its phase, its figures, and the errors of simulations in it."""
        self._adapting = adaptation_of(agent, settings.adaptation, seed)
        self._learning: _Learning | None = None
        if isinstance(agent, Learns) and self._adapting is None:
            self._learning = _Learning(agent, settings.learning_rate, seed)
        self._watch = watch or monitor_of(agent, self._arm)
        self._patience = Patience(arm.spec.name, "movements")
        self._ways: tuple[float, ...] = ()
        self._waiting: list[Recorded] = []
        self._broken: list[Recorded] = []
        self._resume()
        self._cycle = ControlCycle(self._arm, settings.close_while_computing)
        self._warm_up()
        self._counted = {
            phase: Counts.of(saved) for phase, saved in json.loads(store.state(_COUNTS) or b"{}").items()
        }
        self._until = Counts.now(self._cycle)

    def _stored(self) -> list[SequenceEntry]:
        """Return the movements that were finished, in order."""
        return [entry for entry in self._store.catalogue(self._number) if entry.kind == MOVEMENT]

    def _state(self, name: str) -> bytes | None:
        """Return what was kept under ``name``, if the transfer goes on."""
        return self._store.state(name) if self._done else None

    def _resume(self) -> None:
        """Put arm and agent where they were."""
        arm_state = self._store.state("arm")
        if arm_state is not None and self._arm.get_state() is not None:
            self._arm.set_state(arm_state)
        if self._learning is not None and self._done:
            self._learning.set_states(self._store)
        if self._adapting is not None:
            if (state := self._state("adaptation")) is not None:
                self._adapting.set_state(state)
            if not self._done:
                self._keep_version(0, self._arrived)
        self._ways = tuple(json.loads(self._state(_WAYS) or b"[]"))

    def _warm_up(self) -> None:
        """Have everything compiled before the arm moves, and put the monitor where it was."""
        self._judge()
        warm_up_watch(self._watch, self._arm.spec)
        warm_up(self._arrived)
        if self._learning is not None:
            warm_up(self._arrived, self._learning.another())
        seen = self._store.state("watch")
        if seen is not None and self._done:
            self._watch.set_state(seen)
        elif seen is not None:  # of the recording
            with suppress(UnusableInput):  # of an earlier version
                self._watch.know(seen)

    def _judge(self) -> None:
        """Let the monitor judge by the simulation of the agent as it is."""
        if self._adapting is not None:
            self._watch.judge_by(self._adapting.agent.simulation)

    @property
    def agent(self) -> AnyAgent:
        """The agent as it is now."""
        if self._adapting is not None:
            return self._adapting.agent
        return self._arrived if self._learning is None else self._learning.agent

    def run(self, progress: Callable[[float, float], None] | None = None) -> Transferred:
        """Make all movements that are not made yet; return what came of the transfer.

        Raises:
            ArmFailure: the arm failed, or stays broken; the movements up to then are stored.

        """
        phase: Phase = PHASES[0]
        try:
            for phase in PHASES:
                self._make(phase, progress or (lambda done, total: None))
        except BaseException as error:
            if self._arm.get_state() is None:  # no arm can make these movements again
                with suppress(Exception):  # the first failure is the one to tell of
                    self._count(phase)
                    self._keep_rest()
            if isinstance(error, PneumarmError) or not isinstance(error, Exception):
                raise
            raise ArmFailure(
                f"{self._arm.spec.name}: failed in movement {len(self._done) + 1} ({type(error).__name__}: {error}); "
                "see to the arm and run the same command again"
            ) from error
        return self._result()

    def _make(self, phase: Phase, progress: Callable[[float, float], None]) -> None:
        """Make the movements of ``phase`` that are not made yet."""
        settings, learns = self._settings, phase == "learning"
        movements, total = settings.movements(phase), sum(settings.movements(each) for each in PHASES)
        made = sum(info[_PHASE] == phase for info in self._done)
        if phase == "after" and settings.episodes > 0 and made == 0:
            self._adapt(0)
        moving, controller = self.agent, self._controller(phase)
        for number in range(made, movements):
            if learns:
                self._adapt(movements - number)
            if moving is not self.agent and self._adapting is not None:
                moving, controller = self.agent, self._controller(phase)
            movement = self._move(controller, not learns, number)
            if self._learning is not None and learns and number >= (1 - settings.averaged) * movements:
                self._learning.remember()
            self._ways = getattr(controller, "ways", ())
            self._note(phase, movement)
            self._count(phase)
            together = _TOGETHER if self._arm.get_state() is not None else 1
            if len(self._waiting) >= together or number == movements - 1:
                self._keep()
            self._judge_arm(float(movement.recorded.time[-1]))
            progress(len(self._done), total)

    def _controller(self, phase: Phase) -> Controller:
        """Return what moves the arm in ``phase``."""
        if self._learning is not None and phase == "learning":
            return AgentController(self._arrived, self._learning.learner)
        return controller_of(self._knowing())

    def _knowing(self) -> AnyAgent:
        """Return the agent as it is now, with what its controllers have learned of the joints of the arm."""
        agent = self.agent
        return agent.knowing(self._ways) if self._ways and isinstance(agent, Knows) else agent

    def _move(self, controller: Controller, test: bool, number: int) -> Movement:
        """Bring the arm to a begin state and make movement ``number`` of a test or of learning."""
        agent = self._arrived
        velocity, hold = agent.window.velocity, self._settings.hold if agent.settles else 0.0

        def moved() -> Movement:
            draw = draw_movement(goals_of(agent), self._seed, test, number)
            BEGIN.reach(self._cycle.arm, draw.random)
            return move(
                self._cycle, controller, draw.goal, agent.settings, self._watch, self._broken.append, velocity, hold
            )

        return self._cycle.arm.despite_losses(moved)

    def _adapt(self, left: int) -> None:
        """Let the agent adapt where that is due, with so many movements of learning ``left``.

        Of one that settles a version is made only if enough are left to tell whether it is better.
        """
        adapting = self._adapting
        if adapting is None or self._settings.learning_rate == 0:
            return
        if adapting.is_due() or left == 0:
            adapting.prefer()
            self._judge()
        if not adapting.is_due() or (left < COMPARED and self._arrived.settles):
            return
        self._keep()  # it learns from what is stored, so that an interruption changes nothing
        made = [entry.number for entry in self._stored()][-adapting.usable :]
        blocks = list(self._store.blocks(sequences=lambda numbers: np.isin(numbers, made)))
        if blocks and adapting.learn(join_rows(blocks), self._recording()):
            self._judge()
            self._keep_version(adapting.version, adapting.agent)

    def _recording(self) -> Store | None:
        """Return the store where it holds the recording that the agent was made of."""
        return self._store if any(one.kind in KINDS for one in self._store.catalogue()) else None

    def _note(self, phase: Phase, movement: Movement) -> None:
        """Keep what came of a movement, and let the agent take notice of it."""
        info = {_PHASE: phase, **movement.row()}
        if self._adapting is not None:
            judges = self._settings.learning_rate > 0 and phase == "learning"
            recorded = movement.recorded
            sound = not self._watch.marks(recorded)
            settled = not self._arrived.settles or self._has_settled(recorded, movement.goal)
            info[_SQUARES] = self._adapting.observe(
                rows_of(recorded), self._arrived.worth(movement), judges=judges, sound=sound, settled=settled
            )
            self._judge()
        self._done.append(info)
        self._waiting.append(replace(movement.recorded, info=info))

    def _has_settled(self, recorded: Recorded, goal: NDArray[np.float64]) -> bool:
        """Return whether the arm has settled at the ``goal`` (joints,), as it would have by default."""
        off = (recorded.angle - goal) / self._arm.spec.counts_per_degree
        return settled_at(recorded.time, off) is not None

    def _judge_arm(self, time: float) -> None:
        """Give up, with all movements stored, where what is wrong with the arm is no passing trouble.

        The movement just made ended at ``time`` [s].
        """
        try:
            self._patience.judge(self._watch, time)
        except ArmFailure:
            self._keep()
            raise

    def _count(self, phase: Phase) -> None:
        """Count what happened in ``phase`` since it was last counted."""
        before, self._until = self._until, Counts.now(self._cycle)
        self._counted[phase] = self._counted.get(phase, Counts()) + (self._until - before)

    def _keep(self) -> None:
        """Store the movements that wait, with the state of everything after them."""
        state = {"arm": self._arm.get_state(), "watch": self._watch.get_state()}
        state[_WAYS] = json.dumps(self._ways).encode()
        state[_COUNTS] = json.dumps({phase: counts.as_dict() for phase, counts in self._counted.items()}).encode()
        keep_watch(self._store, self._watch, self._number)
        if self._learning is not None:
            state |= self._learning.get_states()
        if self._adapting is not None:
            state["adaptation"] = self._adapting.get_state()
        recorded = [
            replace(one, marks=(*self._watch.marks(one), *one.marks)) for one in (*self._broken, *self._waiting)
        ]
        self._store.append_all(recorded, {name: value for name, value in state.items() if value is not None})
        self._waiting.clear()
        self._broken.clear()

    def _keep_rest(self) -> None:
        """Keep what waits, and nothing twice: a signal may have come between keeping and forgetting it."""
        kept = max(len(self._waiting) - (len(self._done) - len(self._stored())), 0)
        del self._waiting[:kept]
        if self._waiting or self._broken:
            self._keep()

    def _result(self) -> Transferred:
        """Return what came of the transfer."""
        adapted, adapting = None, self._adapting
        if adapting is not None:
            squares = np.array([info[_SQUARES] for info in self._done])
            adapted = Adapted(adapting.version, adapting.quantities, squares, adapting.events)
        phases = {name: [info for info in self._done if info[_PHASE] == name] for name in PHASES}
        return Transferred(
            movements={str(name): of_rows(rows, self._arrived.window.joints) for name, rows in phases.items()},
            agent=self._knowing(),
            learning_rate=0.0 if self._learning is None else self._learning.learning_rate,
            adapted=adapted,
            condition=Condition(tuple(self._watch.findings), self._store.marked_rows(self._number), self._counted),
        )


_PHASE = "phase"  # place of a movement's phase beside its figures in the store
_SQUARES = "squares"  # place of a movement's errors beside its figures in the store
_WAYS = "ways"  # place of what controllers have learned of the joints, among the states in the store
_COUNTS = "counts"  # place of what was counted, among the states in the store


class _Learning:
    """An agent that learns on the arm, and the mean of its weights over movements."""

    def __init__(self, agent: Learns, learning_rate: float, seed: int) -> None:
        self._agent = agent
        self.learning_rate = learning_rate
        self.learner = agent.learner(learning_rate, seed)
        self._sum = np.zeros(agent.weights().shape)
        self._count = 0

    def remember(self) -> None:
        """Count the weights as they are now."""
        self._sum += self.learner.weights()
        self._count += 1

    def another(self) -> LearningActor:
        """Return another learner like the one that moves the arm."""
        return self._agent.learner(self.learning_rate)

    @property
    def agent(self) -> Learns:
        """The agent with the mean of the weights that count, or with those that it has now."""
        if self._count:
            return self._agent.with_weights((self._sum / self._count).astype(np.float32))
        return self._agent.with_weights(self.learner.weights())

    def get_states(self) -> dict[str, bytes]:
        """Return all that its future depends on, by its name in a store."""
        mean = np.int64(self._count).tobytes() + self._sum.tobytes()
        return {"learner": self.learner.get_state(), "mean": mean}

    def set_states(self, store: Store) -> None:
        """Take up what :meth:`get_states` returned, if ``store`` has it."""
        learner, mean = store.state("learner"), store.state("mean")
        if learner is not None and mean is not None:
            self.learner.set_state(learner)
            self._count = int(np.frombuffer(mean[:8], np.int64)[0])
            self._sum = np.frombuffer(mean[8:]).reshape(self._sum.shape).copy()


def transfer_into(
    folder: Path,
    agent: AnyAgent,
    arm: Arm,
    settings: TransferSettings = TransferSettings(),
    *,
    seed: int = 0,
    progress: Callable[[float, float], None] | None = None,
    monitor: Mode = "stop",
) -> dict[str, Any]:
    """Transfer ``agent`` and leave ``episodes.csv``, ``transitions.db`` and the adapted agent in ``folder``.

    Of an agent that adapts between movements its versions and their history stay too, see
    :mod:`~pneumarm.control.versions`. ``monitor`` says what is done about faults that are found meanwhile.

    Raises:
        UnusableInput: the folder cannot be written, or it holds another transfer.

    """
    check_fit(agent, arm)
    make_folder(folder)
    with Store.for_arm(folder / "transitions.db", arm.spec) as store:
        moved = transfer(
            agent,
            arm,
            store,
            settings,
            seed=seed,
            progress=progress,
            keep_version=version_keeper(folder),
            watch=monitor_of(agent, arm, monitor),
        )
    moved.agent.save(folder / ADAPTED)
    save_history(folder, moved.adapted)
    write_episodes(folder / "episodes.csv", moved.movements)
    return moved.results()


def check_fit(agent: AnyAgent | SimulationAgent, arm: Arm) -> None:
    """Raise UnusableInput where ``agent`` was not trained for an arm like this."""
    for name in ("joints", "muscles", "counts_per_degree", "counts_per_bar", "angle_range", "period"):
        trained, found = getattr(agent.spec, name), getattr(arm.spec, name)
        if not np.allclose(trained, found, rtol=1e-3):
            raise UnusableInput(
                f"this agent was trained for an arm whose {name} is {trained}, that of {arm.spec.name} is {found}"
            )
    check_pressures(agent.spec, arm.spec, "this agent was trained")
    agent.window.require(arm.spec.further, arm.spec.name)
