"""A policy adapts to the arm that it moves: its simulation is fitted anew, and it goes on learning in that.

    what the arm did          -> the simulation fits it better than before?  no: all stays as it is
    the simulation as it is now -> the policy goes on learning there: better than before?  no: the policy stays

The networks of the simulation go on from where they are, by Levenberg-Marquardt, on the transitions of the newest
movements and on rehearsed ones: what the simulation that the agent came with says of actions drawn at random. Without
these a fit to a policy's movements, which use few of the actions, forgets the rest (A. Robins, "Catastrophic
forgetting, rehearsal and pseudorehearsal", Connection Science 7(2), 1995).

The newest movements of all are kept out of the fit. They decide whether it is an improvement, and how much noise the
simulation gets. So an agent whose simulation cannot be improved stays as it is.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.valves import VALVES
from pneumarm.errors import UnusableInput
from pneumarm.learning.begin import BeginStates, begin_states
from pneumarm.learning.fleet.agent import PolicyAgent
from pneumarm.learning.fleet.settings import PolicySettings
from pneumarm.learning.fleet.training import PolicyLearner
from pneumarm.learning.settings import check
from pneumarm.networks import LevenbergMarquardt, Network, levenberg_marquardt
from pneumarm.simulation.quality import statistics
from pneumarm.simulation.simulation import Simulation
from pneumarm.transitions.rows import Rows
from pneumarm.transitions.window import Transitions, transitions

_SWITCHES = 0.2  # how often a rehearsed action is another than the one before
_REHEARSED_STEPS = 20  # of a rehearsed movement; the policy's take about ten
_LAYERS = ("hidden_weights", "hidden_bias", "output_weights", "output_bias")


@dataclass(frozen=True)
class AdaptationSettings:
    """How a policy adapts to an arm between movements."""

    every: int = 100
    """Movements between two adaptations; 0: never."""
    newest: int = 1000
    """Movements that the simulation is fitted to, the newest ones."""
    judged: float = 0.2
    """Share of these, the newest of all, that is kept out of the fit and decides whether it is an improvement."""
    gain: float = 0.05
    """Part by which the mean squared errors must be lower, as a geometric mean over the quantities predicted."""
    rehearsed: float = 0.5
    """Rehearsed transitions for each of the arm's."""
    epochs: int = 10
    """Epochs of Levenberg-Marquardt."""
    updates: int = 30
    """How often the policy collects experience in the new simulation and learns from it."""
    warm_up: int = 8
    """Updates before these that learn the values of states alone, which an agent does not keep."""
    learning_rate: float = 1e-3
    """Of the policy, by Adam, at the start; falls linearly to 0."""

    def __post_init__(self) -> None:
        check(
            self,
            every=self.every >= 0,
            newest=self.newest >= 2,
            judged=0 < self.judged < 1,
            gain=0 <= self.gain < 1,
            rehearsed=0 <= self.rehearsed < math.inf,
            epochs=self.epochs >= 1,
            updates=self.updates >= 1,
            warm_up=self.warm_up >= 0,
            learning_rate=0 < self.learning_rate < math.inf,
        )


class Adaptation:
    """A policy agent adapting to an arm. It depends on nothing but its arguments and what :meth:`learn` is given."""

    def __init__(self, agent: PolicyAgent, settings: AdaptationSettings, seed: int = 0) -> None:
        self._origin, self._settings, self._seed = agent, settings, seed
        self.agent = agent
        """The agent as it is now."""
        self.accepted = 0
        """How often the simulation was replaced by one that fits better."""
        self.tried = -1
        """Movements while learning at the last attempt, accepted or not; -1 before the first."""

    def is_due(self, movements: int) -> bool:
        """Whether to :meth:`learn` after so many ``movements`` while learning."""
        return movements > self.tried and self._settings.every > 0 and movements % self._settings.every == 0

    def learn(self, rows: Rows, movements: int) -> None:
        """Adapt to ``rows``, those of movements on the arm, the newest last, after so many ``movements``.

        With too few rows for the fit to be determined, nothing happens.
        """
        self.tried = movements
        simulation = adapted_simulation(
            self.agent.simulation, self._origin.simulation, rows, self._settings, self._seed
        )
        if simulation is None:
            return
        self.accepted += 1
        begin = begin_states(rows, simulation.window, simulation.scaling)
        policy = adapted_policy(self.agent, simulation, begin, self._settings, self._seed + movements)
        self.agent = replace(self.agent, simulation=simulation, policy=policy)

    def get_state(self) -> bytes:
        """Return all that its future depends on besides what it was made with."""
        head = np.array([self.accepted, self.tried], np.float64)
        return b"".join([head.tobytes(), *(part.astype(np.float64).tobytes() for part in _plastic(self.agent))])

    def set_state(self, state: bytes) -> None:
        """Take up a state of :meth:`get_state`, bit for bit.

        Raises:
            UnusableInput: it is of another agent, or damaged.

        """
        parts = _plastic(self._origin)
        numbers = np.frombuffer(state, np.float64) if len(state) % 8 == 0 else np.zeros(0)
        if numbers.size != 2 + sum(part.size for part in parts) or not np.isfinite(numbers).all():
            raise UnusableInput("the state of the adaptation is damaged or of another agent; begin another folder")
        self.accepted, self.tried = int(numbers[0]), int(numbers[1])
        ends = 2 + np.cumsum([part.size for part in parts])
        taken = [numbers[e - p.size : e].reshape(p.shape).copy() for e, p in zip(ends, parts, strict=True)]
        policy, error_std, pressure_range, *layers = taken
        size = len(_LAYERS)
        networks = tuple(Network(*layers[i : i + size]) for i in range(0, len(layers), size))
        simulation = replace(
            self._origin.simulation, networks=networks, error_std=error_std, pressure_range=pressure_range
        )
        self.agent = replace(self._origin, simulation=simulation, policy=policy.astype(np.float32))


def _plastic(agent: PolicyAgent) -> list[NDArray[np.floating]]:
    """Return all arrays that an adaptation changes."""
    simulation = agent.simulation
    layers = [getattr(network, name) for network in simulation.networks for name in _LAYERS]
    return [agent.policy, simulation.error_std, simulation.pressure_range, *layers]


def can_adapt(agent: PolicyAgent) -> bool:
    """Whether the simulation of ``agent`` can be fitted further: a linear one, without hidden units, cannot."""
    return all(network.direct is None for network in agent.simulation.networks)


def adapted_simulation(
    simulation: Simulation, origin: Simulation, rows: Rows, settings: AdaptationSettings, seed: int
) -> Simulation | None:
    """Return ``simulation`` fitted further to ``rows``, or None where that does not make it better.

    ``origin`` says what is rehearsed. Scaling, window and spec stay as they are, so that a policy of the one can act
    in the other.
    """
    window = simulation.window
    found = transitions(_last_sequences(rows, settings.newest), window)
    numbers = np.unique(found.sequence)
    first_judged = numbers[-max(1, round(settings.judged * len(numbers)))] if len(numbers) else 0
    known, judged = _part(found, found.sequence < first_judged), _part(found, found.sequence >= first_judged)
    weights = max(sum(getattr(network, name).size for name in _LAYERS) for network in simulation.networks)
    if len(known.inputs) < weights:
        return None
    count = round(settings.rehearsed * len(known.inputs))
    rehearsed = rehearse(origin, known, count, np.random.default_rng([seed, len(numbers)]))
    inputs = np.concatenate([known.inputs, rehearsed.inputs])
    target = np.concatenate([known.target, rehearsed.target])
    x = simulation.scaling.inputs(inputs, window).astype(np.float32)
    places, scale = simulation.outputs, simulation.scaling.observation_scale
    y = (target[:, places].astype(np.float64) - inputs[:, places]) / scale[places]
    refitted = replace(
        simulation,
        networks=_refitted(simulation.networks, x, y, settings.epochs),
        pressure_range=_reaching(simulation.pressure_range, found, window.joints),
    )
    before, after = statistics(simulation, judged), statistics(refitted, judged)
    squares = [(one.std**2 + one.mean**2)[places] for one in (before, after)]
    if np.log(np.maximum(squares[1], 1e-30) / np.maximum(squares[0], 1e-30)).mean() > math.log1p(-settings.gain):
        return None
    return replace(refitted, error_std=after.std.reshape(window.joints, -1))


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


def rehearse(origin: Simulation, known: Transitions, count: int, random: np.random.Generator) -> Transitions:
    """Return ``count`` transitions that ``origin`` predicts of actions drawn at random.

    Movements begin in the states in which those of ``known`` begin, or in any where there is none.
    """
    window, size = origin.window, origin.window.observation_size
    began = known.inputs[known.step == 0]
    sigma = (began if len(began) else known.inputs)[:, : window.state_size]
    lanes = -(-count // _REHEARSED_STEPS)
    sigma = sigma[random.integers(len(sigma), size=lanes)]
    actions = random.integers(len(VALVES), size=(lanes, window.joints))
    inputs, target = [], []
    for _ in range(_REHEARSED_STEPS):
        drawn = random.integers(len(VALVES), size=actions.shape)
        actions = np.where(random.random(actions.shape) < _SWITCHES, drawn, actions)
        command = VALVES[actions].reshape(lanes, window.command_size).astype(np.float32)
        inputs.append(np.concatenate([sigma, command], axis=1))
        target.append(origin.predict(inputs[-1]).astype(np.float32))
        observed, commanded = sigma[:, : window.history * size], sigma[:, window.history * size :]
        commands = np.concatenate([command, commanded], axis=1)[:, : commanded.shape[1]]
        sigma = np.concatenate([target[-1], observed[:, :-size], commands], axis=1)
    zeros = np.zeros(count)
    return Transitions(
        inputs=np.concatenate(inputs)[:count],
        target=np.concatenate(target)[:count],
        sequence=zeros.astype(np.int64),
        step=zeros.astype(np.int64),
        interval=np.full(count, origin.spec.period, np.float32),
        time=zeros,
    )


def _refitted(
    networks: tuple[Network, ...], x: NDArray[np.float32], y: NDArray[np.float64], epochs: int
) -> tuple[Network, ...]:
    """Return the networks fitted further to all columns of ``y`` (n, outputs), each to its own."""
    solver = LevenbergMarquardt(epochs=epochs)
    columns = np.array_split(y, len(networks), axis=1)
    fitted = []
    for network, of_it in zip(networks, columns, strict=True):
        spread = of_it.std(axis=0)
        spread[spread == 0] = 1.0  # outputs of about 1, as the solver wants them
        scaled = replace(
            network, output_weights=network.output_weights / spread, output_bias=network.output_bias / spread
        )
        one = levenberg_marquardt(x, of_it / spread, scaled, solver).network
        fitted.append(replace(one, output_weights=one.output_weights * spread, output_bias=one.output_bias * spread))
    return tuple(fitted)


def _reaching(pressure_range: NDArray[np.float64], found: Transitions, joints: int) -> NDArray[np.float64]:
    """Return the range of pressures (joints, 2, 2), wide enough for all that were read."""
    pressure = found.target.reshape(-1, joints, 4)[:, :, -2:].astype(np.float64)
    low, high = np.moveaxis(pressure_range, -1, 0)
    return np.stack([np.minimum(low, pressure.min(axis=0)), np.maximum(high, pressure.max(axis=0))], axis=-1)


def _last_sequences(rows: Rows, count: int) -> Rows:
    """Return the rows of the last ``count`` sequences."""
    numbers = np.unique(rows.sequence)
    chosen = rows.sequence >= (numbers[-count] if len(numbers) > count else -1)
    return Rows(**{name: values[chosen] for name, values in vars(rows).items()})


def _part(found: Transitions, chosen: NDArray[np.bool_]) -> Transitions:
    return Transitions(**{name: values[chosen] for name, values in found._asdict().items()})
