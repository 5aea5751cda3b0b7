"""An agent adapts to the arm that it moves: its simulation is fitted anew, and it goes on learning in that.

    after every movement:  does the simulation still predict the arm?         no: the arm has changed, notice when
                           does the adapted agent earn less than before?     yes: the one before it is put back
    now and then:          what the arm did since it changed -> the simulation fits it better?
                           no: all stays as it is.  yes: the agent goes on learning there, and is kept if better

An agent that does not settle at some of its goals, on an arm whose recording is at hand and that is as it was then,
learns more thoroughly: the simulation is fitted on to the recording and to the movements together, and the agent
is made anew in it, for joints that are kept stiffer; later on, whichever was better learns in it for longer. What
keeps a joint from its rest is mostly what a recording of large movements did not show. A simulation of two layers,
whose fit goes on within a second, always is.

The three questions are answered by :mod:`~pneumarm.adaptation.change`, :mod:`~pneumarm.adaptation.trial` and
:mod:`~pneumarm.adaptation.refit`. "Now and then" is after few movements at first, and then each time that their
number has grown by a half, up to ``every``: what a simulation gains by more data falls with their number. A change
that is noticed begins this anew.
"""

import json
from dataclasses import asdict, dataclass, field
from typing import Annotated, Any

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from pneumarm.adaptation.change import (
    ChangeDetector,
    WatchSettings,
    error_squares,
    output_names,
    standardised_squares,
)
from pneumarm.adaptation.events import Event, What
from pneumarm.adaptation.plastic import plastic, with_plastic
from pneumarm.adaptation.refit import Refit, RefitSettings, refit, refit_to_all
from pneumarm.adaptation.trial import TrialSettings, verdict
from pneumarm.errors import UnusableInput
from pneumarm.learning.agents import Acts, Adapts, Retrainable
from pneumarm.settings import NonNegativeInt, PositiveFloat, PositiveInt, PythonOnly, Settings, Share
from pneumarm.simulation import FitSettings
from pneumarm.task.begin import begin_states
from pneumarm.transitions.rows import Rows
from pneumarm.transitions.store import Store

_SETTLED = "settled", "settled_before"  # of the state
_FAILED = 2  # fewest movements that did not settle, for an agent to learn thoroughly: one may be chance
COMPARED = 6
"""Movements that a version of an agent that settles and the one before it must have made, for one to be preferred."""
_GROWTH = 2.0  # from one thorough adaptation to the next: what was learned needs movements to be judged by


@dataclass(frozen=True)
class AdaptationSettings(Settings):
    """How an agent adapts to an arm between movements."""

    first: Annotated[PositiveInt, PythonOnly] = 10
    """Movements until the first adaptation, on arrival and after a change that was noticed."""
    growth: Annotated[float, Meta(gt=1), PythonOnly] = 1.5
    """Factor by which their number grows from one adaptation to the next."""
    every: NonNegativeInt = 100
    """Most movements between two adaptations; 0: never."""
    updates: PositiveInt = 30
    """How often the policy collects experience in the new simulation and learns from it."""
    warm_up: Annotated[NonNegativeInt, PythonOnly] = 8
    """Updates before these that learn the values of states alone, which an agent does not keep."""
    learning_rate: PositiveFloat = 1e-3
    """Learning rate of the policy, by Adam, at the start; falls linearly to 0."""
    unsettled: Annotated[Share, PythonOnly] = 0.05
    """Share of movements, and two at least, that do not settle above which an agent that is to settle learns more
    thoroughly."""
    thorough_updates: Annotated[NonNegativeInt, PythonOnly] = 400
    """Updates then."""
    thorough_rate: Annotated[PositiveFloat, PythonOnly] = 4e-3
    """Learning rate then."""
    refit: Annotated[RefitSettings, PythonOnly] = field(default_factory=RefitSettings)
    """How the simulation is fitted further."""
    watch: Annotated[WatchSettings, PythonOnly] = field(default_factory=WatchSettings)
    """When the arm counts as changed."""
    trial: Annotated[TrialSettings, PythonOnly] = field(default_factory=TrialSettings)
    """When an adapted agent is taken back."""


class Adaptation:
    """An agent adapting to an arm. It depends on nothing but its arguments and what it is told.

    It is told of every movement by :meth:`observe`. :meth:`learn` makes a new version of the agent, which
    :meth:`observe` may take back.
    """

    def __init__(self, agent: Adapts, settings: AdaptationSettings, seed: int = 0) -> None:
        self._origin, self._settings, self._seed = agent, settings, seed
        self.agent = agent
        """The agent as it is now."""
        self.version = 0
        """Its number."""
        self.versions = 1
        """Versions so far, the one that arrived and those taken back counted."""
        self.events: list[Event] = []
        self._watch = ChangeDetector(settings.watch, len(agent.simulation.outputs))
        self._began = 0  # movement since which the arm is as it is now
        self._tried = -1  # movement of the last attempt to learn
        self._trusted, self._trusted_version = agent, 0  # what is put back if the agent is worse
        self._old: list[float] = []  # rewards of the trusted agent
        self._new: list[float] = []  # rewards of the agent that is on trial
        self._settled: list[bool] = []  # whether movements of the agent as it is did
        self._settled_before: list[bool] = []  # of the trusted agent, while another is on trial
        self._thorough = False  # whether its newest version learned thoroughly
        self._stiff = self._trusted_stiff = False  # whether the agent, and the trusted one, were made anew
        self._retrained = False  # whether any was
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

    def observe(
        self, rows: Rows, reward: float, *, judges: bool = True, sound: bool = True, settled: bool = True
    ) -> list[list[float]]:
        """Take notice of a movement: its ``rows`` and its ``reward``; with ``judges`` an agent may be taken back.

        ``settled`` tells whether it did, where it was to.

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
        self._settled = [*self._settled, settled][-self._settings.trial.remembered :]
        if self._watch.observe(now):
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
        self._add("noticed", since=since, ratio=self.ratio.tolist())
        if since > self._began + self._settings.trial.fewest:
            # Rewards on the arm as it was say nothing about agents on the arm as it is.
            self._began = since
            self._trust()

    def _judge(self) -> None:
        found = verdict(self._old, self._new, self._settings.trial)
        if found == "confirmed":
            self._trust()
        elif found == "worse":
            self._put_back()
            self._tried = self.movements

    def prefer(self) -> None:
        """Go on with the version of an agent that settles, or the one before it, whichever was better on average.

        What it learned in a simulation changes how it comes to rest for better or worse, by more than a trial that is
        to be sure finds out in time.
        """
        compared = self.version != self._trusted_version and len(self._new) >= COMPARED <= len(self._old)
        if compared and self._origin.settles:
            if np.mean(self._new) < np.mean(self._old):
                self._put_back()
            else:
                self._trust()

    def _put_back(self) -> None:
        """Go on with the trusted agent."""
        worse, means = self.version, [float(np.mean(rewards)) for rewards in (self._old, self._new)]
        self.agent, self.version, self._new = self._trusted, self._trusted_version, []
        self._stiff = self._trusted_stiff
        self._settled, self._settled_before = self._settled_before, []  # it fails as often as it did
        self._watch.reset()
        self._add("rolled back", taken_back=worse, reward_before=means[0], reward_after=means[1])

    def _trust(self) -> None:
        """Count the agent as proven."""
        remembered = self._settings.trial.remembered
        self._trusted, self._trusted_version, self._trusted_stiff = self.agent, self.version, self._stiff
        self._old, self._new, self._settled_before = self._new[-remembered:], [], []

    def is_due(self) -> bool:
        """Whether to :meth:`learn` now."""
        every, made = self._settings.every, self.movements - self._began
        if every == 0 or self.movements == self._tried or made < min(self._settings.first, every):
            return False
        tried = self._tried - self._began
        growth = max(self._settings.growth, _GROWTH) if self._thorough else self._settings.growth
        return tried < 0 or made - tried >= every or made >= growth * tried

    def learn(self, rows: Rows, recorded: Store | None = None) -> bool:
        """Adapt to ``rows``, those of the :attr:`usable` movements, the newest last; whether there is a new version.

        ``recorded`` holds these movements and the recording that the agent was made of, where that is at hand. With
        too few movements nothing happens.
        """
        self._tried = self.movements
        tuned, now = self._settings, self.agent.simulation
        updates, rate = tuned.updates, tuned.learning_rate
        is_thorough = self._is_thorough()
        recording = recorded if is_thorough or self._knows_on() else None
        if recording is not None:
            ahead = FitSettings.ahead if is_thorough else 0.0
            if is_thorough:
                updates, rate = tuned.thorough_updates, tuned.thorough_rate
            found: Refit | None = refit_to_all(now, recording, rows, ahead)
        else:
            found = refit(now, self._origin.simulation, rows, tuned.refit, self._seed)
        if found is None:
            return False
        if found.better:
            simulation = found.simulation
            begin = begin_states(rows, simulation.window, simulation.scaling, simulation.spec)
            seed = self._seed + self.movements
            if recording is not None and is_thorough and not self._retrained and isinstance(self.agent, Retrainable):
                self.agent = self.agent.stiffer().retrained(simulation, begin, seed)
                self._stiff = self._retrained = True
            else:
                self.agent = self.agent.adapted(simulation, begin, updates, tuned.warm_up, rate, seed)
            self.version, self.versions, self._thorough = self.versions, self.versions + 1, recording is not None
            self._new = []
            if not self._settled_before:
                self._settled_before = self._settled
            self._settled = []
            self._watch.reset()
        self._add("accepted" if found.better else "refused", **self._figures(found))
        return found.better

    def _is_thorough(self) -> bool:
        """Whether to learn more thoroughly: the agent fails to settle, on an arm that has not changed."""
        failed, settings = self._settled.count(False), self._settings
        simulation = self.agent.simulation
        return (
            failed >= _FAILED
            and failed > settings.unsettled * len(self._settled)
            and settings.thorough_updates > 0
            and self._began == 0
            and not simulation.spread  # or what it was taught of pulses would be forgotten
        )

    def _knows_on(self) -> bool:
        """Whether the simulation is fitted on with the recording, on an arm that is as it was.

        One of two layers is, of an agent that is to reach goals: one that settles learns more thoroughly if at all.
        """
        simulation = self.agent.simulation
        two_layers = simulation.networks[0].second_weights is not None
        return two_layers and self._began == 0 and not self._origin.settles

    def _figures(self, found: Refit) -> dict[str, Any]:
        unit = np.sqrt(error_squares(self._origin.simulation))
        return {
            "movements": found.movements,
            "before": (found.before / unit).tolist(),
            "after": (found.after / unit).tolist(),
        }

    def _add(self, what: What, **figures: Any) -> None:
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
            **dict(zip(_SETTLED, (self._settled, self._settled_before), strict=True)),
            "thorough": self._thorough,
            "stiff": [self._stiff, self._trusted_stiff, self._retrained],
            "events": [asdict(event) for event in self.events],
            "watch": self._watch.get_state(),
        }
        text = json.dumps(head).encode()
        numbers = [plastic(agent).tobytes() for agent in (self.agent, self._trusted)]
        return b"".join([np.int64(len(text)).tobytes(), text, *numbers])

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
            self._settled, self._settled_before = (list(map(bool, head[name])) for name in _SETTLED)
            self._thorough = bool(head["thorough"])
            self._stiff, self._trusted_stiff, self._retrained = map(bool, head["stiff"])
            self.events = [Event(**event) for event in head["events"]]
            self._watch.set_state(head["watch"])
        except (ValueError, TypeError, KeyError, IndexError) as error:
            raise UnusableInput(
                f"the state of the adaptation is damaged or of another agent ({error}); begin another folder"
            ) from error
        size = plastic(self._origin).size
        if numbers.size != 2 * size or not np.isfinite(numbers).all():
            raise UnusableInput("the state of the adaptation is damaged or of another agent; begin another folder")
        now, trusted = np.split(numbers, 2)
        self.agent, self._trusted = self._restored(now, self._stiff), self._restored(trusted, self._trusted_stiff)

    def _restored(self, numbers: NDArray[np.float64], stiff: bool) -> Adapts:
        """Return the agent that had these ``numbers`` of :func:`plastic` and was made anew, ``stiff``, or not."""
        origin = self._origin
        return with_plastic(origin.stiffer() if stiff and isinstance(origin, Retrainable) else origin, numbers)


def adaptation_of(agent: Acts, settings: AdaptationSettings, seed: int = 0) -> Adaptation | None:
    """Return how ``agent`` adapts to an arm between movements; None for agents that do not.

    A linear simulation, without hidden units, cannot be fitted further.
    """
    if settings.every == 0 or not isinstance(agent, Adapts):
        return None
    linear = any(network.direct is not None for network in agent.simulation.networks)
    return None if linear else Adaptation(agent, settings, seed)
