"""A policy adapts to the arm that it moves: its simulation is fitted anew, and it goes on learning in that.

    after every movement:  does the simulation still predict the arm?         no: the arm has changed, notice when
                           does the adapted policy earn less than before?     yes: the one before it is put back
    now and then:          what the arm did since it changed -> the simulation fits it better?
                           no: all stays as it is.  yes: the policy goes on learning there, and is kept if better

The three questions are answered by :mod:`~pneumarm.adaptation.change`, :mod:`~pneumarm.adaptation.trial` and
:mod:`~pneumarm.adaptation.refit`. "Now and then" is after few movements at first, and then each time that their
number has grown by a half, up to ``every``: what a simulation gains by more data falls with their number. A change
that is noticed begins this anew.
"""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from pneumarm.adaptation.change import Watch, WatchSettings, error_squares, output_names, standardised_squares
from pneumarm.adaptation.refit import Refit, RefitSettings, refit
from pneumarm.adaptation.trial import TrialSettings, verdict
from pneumarm.errors import UnusableInput
from pneumarm.learning.fleet_settings import PolicySettings
from pneumarm.learning.methods import AnyAgent
from pneumarm.learning.policy.agent import PolicyAgent
from pneumarm.learning.policy.training import PolicyLearner
from pneumarm.networks import Network
from pneumarm.settings import Settings, Valid
from pneumarm.simulation.simulation import Simulation
from pneumarm.task.begin import BeginStates, begin_states
from pneumarm.transitions.rows import Rows

_LAYERS = ("hidden_weights", "hidden_bias", "output_weights", "output_bias")
_KNOWN = ("error_std", "pressure_range", "further_std", "further_range")
What = Literal["noticed", "accepted", "refused", "rolled back"]


@dataclass(frozen=True)
class AdaptationSettings(Settings):
    """How a policy adapts to an arm between movements."""

    first: int = 10
    """Movements until the first adaptation, on arrival and after a change that was noticed."""
    growth: float = 1.5
    """Factor by which their number grows from one adaptation to the next."""
    every: int = 100
    """Most movements between two adaptations; 0: never."""
    updates: int = 30
    """How often the policy collects experience in the new simulation and learns from it."""
    warm_up: int = 8
    """Updates before these that learn the values of states alone, which an agent does not keep."""
    learning_rate: float = 1e-3
    """Of the policy, by Adam, at the start; falls linearly to 0."""
    refit: RefitSettings = field(default_factory=RefitSettings)
    """How the simulation is fitted further."""
    watch: WatchSettings = field(default_factory=WatchSettings)
    """When the arm counts as changed."""
    trial: TrialSettings = field(default_factory=TrialSettings)
    """When an adapted agent is taken back."""

    def _valid(self) -> Valid:
        return {
            "first": self.first >= 1,
            "growth": 1 < self.growth < math.inf,
            "every": self.every >= 0,
            "updates": self.updates >= 1,
            "warm_up": self.warm_up >= 0,
            "learning_rate": 0 < self.learning_rate < math.inf,
        }


@dataclass(frozen=True)
class Event:
    """Something that happened to an adapting agent."""

    what: What
    movement: int
    """Movements made on the arm by then, those of tests counted."""
    version: int
    """Of the agent after it; 0 is the one that arrived."""
    figures: Mapping[str, Any]
    """``noticed``: since (the movement) and ratio; ``accepted``, ``refused``: movements, and the errors before and
    after over those of the fit; ``rolled back``: the mean rewards before and after, and the version taken back.
    Ratios are of angle, pressure 1, pressure 2, joint after joint."""


class Adaptation:
    """A policy agent adapting to an arm. It depends on nothing but its arguments and what it is told.

    It is told of every movement by :meth:`saw`. :meth:`learn` makes a new version of the agent, which :meth:`saw` may
    take back.
    """

    def __init__(self, agent: PolicyAgent, settings: AdaptationSettings, seed: int = 0) -> None:
        self._origin, self._settings, self._seed = agent, settings, seed
        self.agent = agent
        """The agent as it is now."""
        self.version = 0
        """Its number."""
        self.versions = 1
        """Versions so far, the one that arrived and those taken back counted."""
        self.events: list[Event] = []
        self._watch = Watch(settings.watch, len(agent.simulation.outputs))
        self._began = 0  # movement since which the arm is as it is now
        self._tried = -1  # movement of the last attempt to learn
        self._trusted, self._trusted_version = agent, 0  # what is put back if the agent is worse
        self._old: list[float] = []  # rewards of the trusted agent
        self._new: list[float] = []  # rewards of the agent that is on trial
        self.quantities = output_names(agent.simulation)
        """What the ratios are of."""

    @property
    def accepted(self) -> int:
        """How often a new version was made."""
        return self.versions - 1

    @property
    def movements(self) -> int:
        """Movements that it was told of."""
        return self._watch.movements

    @property
    def usable(self) -> int:
        """The newest movements that :meth:`learn` should be given: no more than since the arm changed."""
        return min(self.movements - self._began, self._settings.refit.newest)

    @property
    def ratio(self) -> NDArray[np.float64]:
        """Error of the simulation in the last movements over that of its fit, shape (outputs,)."""
        return self._watch.ratio

    def saw(self, rows: Rows, reward: float, *, judges: bool = True, sound: bool = True) -> list[list[float]]:
        """Take notice of a movement: its ``rows`` and its ``reward``; with ``judges`` an agent may be taken back.

        A movement that is not ``sound``, of an arm with a fault, is counted and nothing else: it tells neither how
        the arm is nor what an agent is worth.

        Returns the mean standardised squared errors in it (2, outputs) of the simulation that arrived and of the one
        in use, for people.
        """
        now = standardised_squares(self.agent.simulation, rows)
        arrived = now if self.version == 0 else standardised_squares(self._origin.simulation, rows)
        if not sound:
            self._watch.skip()
            return [arrived.tolist(), now.tolist()]
        if self._watch.saw(now):
            self._notice()
        if self.version == self._trusted_version:
            self._old = [*self._old, reward][-self._settings.trial.remembered :]
        else:
            self._new.append(reward)
            if judges:
                self._judge()
        return [arrived.tolist(), now.tolist()]

    def _notice(self) -> None:
        since = self._watch.since
        self._tell("noticed", since=since, ratio=self.ratio.tolist())
        if since > self._began + self._settings.trial.fewest:
            # Rewards on the arm as it was say nothing about agents on the arm as it is.
            self._began = since
            self._trust()

    def _judge(self) -> None:
        found = verdict(self._old, self._new, self._settings.trial)
        if found == "confirmed":
            self._trust()
        elif found == "worse":
            worse, means = self.version, [float(np.mean(rewards)) for rewards in (self._old, self._new)]
            self.agent, self.version, self._new = self._trusted, self._trusted_version, []
            self._watch.reset()
            self._tried = self.movements
            self._tell("rolled back", taken_back=worse, reward_before=means[0], reward_after=means[1])

    def _trust(self) -> None:
        """Count the agent as proven."""
        remembered = self._settings.trial.remembered
        self._trusted, self._trusted_version = self.agent, self.version
        self._old, self._new = self._new[-remembered:], []

    def is_due(self) -> bool:
        """Whether to :meth:`learn` now."""
        every, made = self._settings.every, self.movements - self._began
        if every == 0 or self.movements == self._tried or made < min(self._settings.first, every):
            return False
        tried = self._tried - self._began
        return tried < 0 or made - tried >= every or made >= self._settings.growth * tried

    def learn(self, rows: Rows) -> bool:
        """Adapt to ``rows``, those of the :attr:`usable` movements, the newest last; whether there is a new version.

        With too few movements nothing happens.
        """
        self._tried = self.movements
        found = refit(self.agent.simulation, self._origin.simulation, rows, self._settings.refit, self._seed)
        if found is None:
            return False
        if found.better:
            simulation = found.simulation
            begin = begin_states(rows, simulation.window, simulation.scaling)
            policy = adapted_policy(self.agent, simulation, begin, self._settings, self._seed + self.movements)
            self.agent = replace(self.agent, simulation=simulation, policy=policy)
            self.version, self.versions = self.versions, self.versions + 1
            self._new = []
            self._watch.reset()
        self._tell("accepted" if found.better else "refused", **self._told(found))
        return found.better

    def _told(self, found: Refit) -> dict[str, Any]:
        unit = np.sqrt(error_squares(self._origin.simulation))
        return {
            "movements": found.movements,
            "before": (found.before / unit).tolist(),
            "after": (found.after / unit).tolist(),
        }

    def _tell(self, what: What, **figures: Any) -> None:
        self.events.append(Event(what, self.movements, self.version, figures))

    def get_state(self) -> bytes:
        """Return all that its future depends on besides what it was made with."""
        head = {
            "version": self.version,
            "versions": self.versions,
            "began": self._began,
            "tried": self._tried,
            "trusted": self._trusted_version,
            "old": self._old,
            "new": self._new,
            "events": [asdict(event) for event in self.events],
            "watch": self._watch.get_state(),
        }
        text = json.dumps(head).encode()
        arrays = [part for agent in (self.agent, self._trusted) for part in _plastic(agent)]
        return b"".join(
            [np.int64(len(text)).tobytes(), text, *(part.astype(np.float64).tobytes() for part in arrays)]
        )

    def set_state(self, state: bytes) -> None:
        """Take up a state of :meth:`get_state`, bit for bit.

        Raises:
            UnusableInput: it is of another agent, or damaged.

        """
        try:
            length = int(np.frombuffer(state[:8], np.int64)[0])
            head = json.loads(state[8 : 8 + length])
            numbers = np.frombuffer(state[8 + length :], np.float64)
            self.version, self.versions = int(head["version"]), int(head["versions"])
            self._began, self._tried = int(head["began"]), int(head["tried"])
            self._trusted_version = int(head["trusted"])
            self._old, self._new = list(map(float, head["old"])), list(map(float, head["new"]))
            self.events = [Event(**event) for event in head["events"]]
            self._watch.set_state(head["watch"])
        except (ValueError, TypeError, KeyError, IndexError) as error:
            raise UnusableInput(
                f"the state of the adaptation is damaged or of another agent ({error}); begin another folder"
            ) from error
        size = sum(part.size for part in _plastic(self._origin))
        if numbers.size != 2 * size or not np.isfinite(numbers).all():
            raise UnusableInput("the state of the adaptation is damaged or of another agent; begin another folder")
        self.agent, self._trusted = (_with_plastic(self._origin, part) for part in np.split(numbers, 2))


def _plastic(agent: PolicyAgent) -> list[NDArray[np.floating]]:
    """Return all arrays that an adaptation changes."""
    simulation = agent.simulation
    layers = [getattr(network, name) for network in simulation.networks for name in _LAYERS]
    return [agent.policy, *(getattr(simulation, name) for name in _KNOWN), *layers]


def _with_plastic(agent: PolicyAgent, numbers: NDArray[np.float64]) -> PolicyAgent:
    """Return ``agent`` with other :func:`_plastic` arrays, one after the other in ``numbers``."""
    parts = _plastic(agent)
    ends = np.cumsum([part.size for part in parts])
    taken = [numbers[e - p.size : e].reshape(p.shape).copy() for e, p in zip(ends, parts, strict=True)]
    policy, known, layers = taken[0], taken[1 : 1 + len(_KNOWN)], taken[1 + len(_KNOWN) :]
    size = len(_LAYERS)
    networks = tuple(Network(*layers[i : i + size]) for i in range(0, len(layers), size))
    changed: dict[str, Any] = dict(zip(_KNOWN, known, strict=True))
    simulation = replace(agent.simulation, networks=networks, **changed)
    return replace(agent, simulation=simulation, policy=policy.astype(np.float32))


def can_adapt(agent: PolicyAgent) -> bool:
    """Whether the simulation of ``agent`` can be fitted further: a linear one, without hidden units, cannot."""
    return all(network.direct is None for network in agent.simulation.networks)


def adapted_policy(
    agent: PolicyAgent, simulation: Simulation, begin: BeginStates, settings: AdaptationSettings, seed: int
) -> NDArray[np.float32]:
    """Return the weights of ``agent`` after learning in ``simulation``, or as they were where those are better."""
    updates = settings.warm_up + settings.updates
    tuned = replace(agent.settings, updates=updates, learning_rate=settings.learning_rate)
    learner = _Tuner(simulation, begin, tuned, seed, settings.warm_up)
    learner.policy.flat[:] = agent.policy
    before = learner.validate(agent.settings.validation_episodes).reward.mean()
    learner.learn(updates)
    after = learner.validate(agent.settings.validation_episodes).reward.mean()
    return learner.policy.flat if after > before else agent.policy


class _Tuner(PolicyLearner):
    """A policy that is kept as it is until the values of states are known."""

    def __init__(
        self, simulation: Simulation, begin: BeginStates, settings: PolicySettings, seed: int, warm_up: int
    ) -> None:
        super().__init__(simulation, begin, settings, seed, 0)
        self._warm_up = warm_up

    def rates(self) -> tuple[float, float]:
        """Return the learning rates of policy and values."""
        done, updates = int(self.counts[0]), self._settings.updates
        left = 1 - max(done - self._warm_up, 0) / (updates - self._warm_up)
        return (self._settings.learning_rate * left if done >= self._warm_up else 0.0), _VALUE_RATE * left


_VALUE_RATE = 4e-3  # of a policy's training, whose values begin at random, too


def told(events: Sequence[Event], quantities: Sequence[str]) -> list[str]:
    """Return the ``events`` that matter to people as sentences; attempts that changed nothing are left out."""
    lines = []
    for event in events:
        found = event.figures
        if event.what == "noticed":
            ratio = np.array(found["ratio"])
            worst = int(ratio.argmax())
            lines.append(
                f"the arm has changed: noticed after movement {event.movement}, since about movement "
                f"{found['since'] + 1} (error of {quantities[worst].replace('_', ' ')} {ratio[worst]:.1f} times that "
                "of the fit)"
            )
        elif event.what == "accepted":
            before, after = (float(np.exp(np.log(found[name]).mean())) for name in ("before", "after"))
            lines.append(
                f"version {event.version} after movement {event.movement}: fitted to {found['movements']} movements, "
                f"error {before:.2f} -> {after:.2f} times that of the fit"
            )
        elif event.what == "rolled back":
            lines.append(
                f"version {found['taken_back']} taken back after movement {event.movement}: reward "
                f"{found['reward_before']:.1f} -> {found['reward_after']:.1f}; again version {event.version}"
            )
    return lines


def adaptation(agent: AnyAgent, settings: AdaptationSettings, seed: int = 0) -> Adaptation | None:
    """Return how ``agent`` adapts to an arm between movements; None for kinds that do not, or learn while moving."""
    adapts = isinstance(agent, PolicyAgent) and settings.every > 0 and can_adapt(agent)
    return Adaptation(agent, settings, seed) if isinstance(agent, PolicyAgent) and adapts else None
