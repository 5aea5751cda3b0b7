"""A trained servo and its file, which holds all it needs to act, and its training.

Several servos are trained at once from different weights, of which the best is kept.
"""

import time
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from pneumarm.learning.network_agent import NetworkAgent
from pneumarm.learning.servo.actor import ServoActor
from pneumarm.learning.servo.controller import ServoController, ready_controller
from pneumarm.learning.servo.gradient import (
    ServoTask,
    errors_of,
    learn_once,
    move_forward,
    tape,
)
from pneumarm.learning.servo.predictive import PLANS, PredictiveControl
from pneumarm.learning.servo.references import draw_references, write_previews
from pneumarm.learning.servo.settings import SOFT, STIFF, USUAL_PERIOD, ServoSettings
from pneumarm.learning.servo.task import servo_sizes, servo_task
from pneumarm.learning.servo.testing import run_servo
from pneumarm.learning.training import Learner, Training, identity_of, train_side_by_side
from pneumarm.networks.layers import adam, initial_weights, split, trainable
from pneumarm.simulation.simulation import Simulation
from pneumarm.task.begin import BeginStates
from pneumarm.task.changes import valve_changes
from pneumarm.task.environment import environment
from pneumarm.task.movements import Movement, Movements, movements
from pneumarm.task.price import prices_of_errors

KIND = "pneumarm servo"
_WEIGHTS, _MOVEMENTS, _VALIDATION = 0, 1, 2  # streams of random numbers
_ROW = 25  # updates between two rows of the curves
_FIRST_OUTPUT = 1.0  # the first policy opens valves now and then
_RENEWED = 0.5  # share of arms that begin anew at rest; the others go on from where they are
_FREE = 0.6  # share of the updates in which the price of changes rises to what it is
_STEEPEST = 10.0  # where derivatives are cut off in the first update, at the usual period
_STEEPEST_LAST = 40.0, 400.0  # and in the last, by every other agent: which is better depends on the arm
_COARSE = 0.0, 0.1, 0.2, 0.3, 0.4  # periods that are tried
_COSTS_NOTHING = 0.005  # share of the price, and of movements that settle, by which coarser commands may cost more
_FASTEST = 4.0  # highest speed of a reference, in scaled velocities


@dataclass(frozen=True, repr=False)
class ServoAgent(NetworkAgent):
    """A policy over pulses by state and reference, and the simulation that it was trained in."""

    kind = KIND
    settings_type = ServoSettings
    settles = True

    settings: ServoSettings

    @property
    def sizes(self) -> tuple[int, ...]:
        """Units of each layer of the policy, inputs first."""
        return servo_sizes(self.simulation, self.settings)

    @property
    def task(self) -> ServoTask:
        """What it does, for kernels."""
        return servo_task(self.simulation, self.settings)

    def controller(self) -> ServoController:
        """Return it as a controller of an arm, which settles, holds and tracks; all that it needs is compiled."""
        return ready_controller(self)

    def knowing(self, ways: tuple[float, ...]) -> Self:
        """Return the servo with what its controller has learned of the joints of its arm."""
        return replace(self, settings=replace(self.settings, ways=ways))

    def worth(self, movement: Movement) -> float:
        """Return minus the mean price of the errors after the first reading."""
        tolerance = self.settings.tolerance * self.spec.counts_per_degree
        paid = prices_of_errors(self.task.prices, (movement.recorded.angle[1:] - movement.goal) / tolerance)
        return -float(paid.sum(axis=1).mean())

    def actor(self) -> ServoActor:
        """Return it acting state by state."""
        return ServoActor(self)

    def predictive(self) -> PredictiveControl | None:
        """Return what plans with its policy's proposals; None where it is not to plan."""
        if not self.settings.planned:
            return None
        policy = trainable(self.policy.copy(), self.sizes, PLANS)
        return PredictiveControl(self.simulation, self.task, self.settings.planned, policy)

    def test(self, simulation: Simulation, begin: BeginStates, episodes: int, seed: tuple[int, ...]) -> Movements:
        """Let the servo reach goals in ``simulation``."""
        return run_servo(self, simulation, begin, episodes, seed)

    def adapted(
        self, simulation: Simulation, begin: BeginStates, updates: int, warm_up: int, learning_rate: float, seed: int
    ) -> Self:
        """Return the servo after learning in ``simulation``, which needs no warming up."""
        tuned = replace(self.settings, updates=updates, learning_rate=learning_rate)
        return self.revised(simulation, tuned_servo(self.policy, simulation, begin, tuned, seed))

    def stiffer(self) -> Self:
        """Return the servo to keep :data:`.STIFF` of the range of pressures where it learns on.

        One of which another stiffness than the usual :data:`.SOFT` was asked for stays as it is.
        """
        wanted = self.settings.stiffness
        return replace(self, settings=replace(self.settings, stiffness=STIFF if wanted in (None, SOFT) else wanted))

    def retrained(self, simulation: Simulation, begin: BeginStates, seed: int) -> Self:
        """Return the servo trained from the beginning in ``simulation``; how coarse its commands are stays."""
        return self.revised(simulation, train_servo(simulation, begin, self.settings, seed).agent.policy)


def train_servo(
    simulation: Simulation, begin_states: BeginStates, settings: ServoSettings, seed: int = 0, **how: Any
) -> Training[ServoAgent]:
    """Train servos and return the best; ``how`` as of :func:`~pneumarm.learning.training.train_side_by_side`."""
    return train_side_by_side(
        lambda number: ServoLearner(simulation, begin_states, settings, seed, number),
        settings.agents,
        settings.validation_movements,
        identity_of(environment(simulation, begin_states, settings), settings, seed),
        **how,
    )


def tuned_servo(
    policy: NDArray[np.float32], simulation: Simulation, begin_states: BeginStates, settings: ServoSettings, seed: int
) -> NDArray[np.float32]:
    """Return the weights ``policy`` after learning on in ``simulation``, or as they were where that is better."""
    learners = [ServoLearner(simulation, begin_states, settings, seed, 0, policy) for _ in range(2)]
    learners[0].price_all_along = True
    while not learners[0].ended:
        learners[0].learn_on()
    rewards = [one.validate(settings.validation_movements).reward.mean() for one in learners]
    return learners[0 if rewards[0] > rewards[1] else 1].net.flat.copy()


class ServoLearner(Learner[ServoAgent]):
    """One servo that learns, with its simulated arms. What it draws depends on its seed and the update alone."""

    columns = ("episodes", "price", "settled")
    """Mean price of a step, and share of the last third of movements within tolerance, since the row before."""
    price_all_along = False
    """Whether changes of valves have their whole price from the first update on, as for a policy that does well."""

    def __init__(
        self,
        simulation: Simulation,
        begin: BeginStates,
        settings: ServoSettings,
        seed: int,
        number: int,
        policy: NDArray[np.float32] | None = None,
    ) -> None:
        super().__init__()
        if settings.stiffness is None:
            settings = replace(settings, stiffness=(SOFT, STIFF)[number % 2])
        self.simulation, self.settings, self._begin = simulation, settings, begin
        self._seed, self._number = seed, number
        self.task = servo_task(simulation, settings)
        sizes = servo_sizes(simulation, settings)
        if policy is None:
            policy = initial_weights(sizes, _FIRST_OUTPUT, np.random.default_rng([seed, _WEIGHTS, number]))
        weights, mask = policy.copy(), np.ones_like(policy)
        if simulation.spec.muscles == 1:  # a muscle that is not there is told nothing: 0 is a closed valve
            for layers in (split(weights, sizes), split(mask, sizes)):
                layers[-1][:, 1::2] = 0.0
        self.net = trainable(weights, sizes, settings.arms, mask)
        steps = max(round(settings.duration / simulation.spec.period), 2)
        self.tape = tape(self.task, steps, settings.arms, sum(settings.hidden))
        self.updates = np.zeros(1, np.int64)

    @property
    def ended(self) -> bool:
        """Whether there have been as many updates as were asked for."""
        return bool(self.updates[0] >= self.settings.updates)

    @property
    def share(self) -> float:
        """How far it is, 0 to 1."""
        return float(self.updates[0]) / self.settings.updates

    @property
    def episodes(self) -> int:
        """Movements so far."""
        return int(self.updates[0]) * self.settings.arms

    @property
    def steps(self) -> int:
        """Steps of all simulated arms so far."""
        return self.episodes * len(self.tape.slope)

    def warm_up(self) -> None:
        """Learn once."""
        self._update()

    def learn_on(self) -> None:
        """Move and learn until the next row of the curve."""
        began, price, count = time.thread_time(), 0.0, 0
        while count < _ROW and not self.ended:
            price += self._update()
            count += 1
        late = errors_of(self.task, self.tape)[-len(self.tape.slope) // 3 :]
        self.add_row([self.episodes, price / count, float((np.abs(late) <= 1).mean())], time.thread_time() - began)

    def validate(self, episodes: int) -> Movements:
        """Return movements in which references are followed, the same for all learners.

        ``reward`` is what errors and changes of valves cost, negative: what pressures cost only shapes learning, and
        soft and stiff joints are compared. ``success`` whether they stayed within tolerance in the last third.
        """
        joints, steps = self.simulation.window.joints, len(self.tape.slope)
        parts = []
        for part in range(-(-episodes // self.settings.arms)):
            self._prepare(np.random.default_rng([self._seed, _VALIDATION, part]), np.ones(self.settings.arms, bool))
            move_forward(self.task, self.net, self.tape)
            made = movements(self.settings.arms, joints)
            error = errors_of(self.task, self.tape)
            made.goal[:], made.angle_begin[:], made.angle_end[:] = (
                self._counts(x).T for x in (self.tape.reference[-1], self._angles(0), self._angles(-1))
            )
            changes = self._valve_changes()
            made.actions[:], made.switches[:] = steps, changes.T
            prices = self.task.prices
            cost = prices_of_errors(prices, error).sum(axis=(0, 1))
            made.reward[:] = -cost - prices.change * changes.sum(axis=0)
            made.success[:] = (np.abs(error[-steps // 3 :]) <= 1).all(axis=(0, 1))
            parts.append(made)
        return Movements(*(np.concatenate(columns)[:episodes] for columns in zip(*parts, strict=True)))

    def agent(self) -> ServoAgent:
        """Return the servo as it is now."""
        settings = replace(self.settings, coarse=self._coarse())
        return ServoAgent(self.simulation, self.net.flat.copy(), settings)

    def _coarse(self) -> float:
        """Return how coarse commands may be on the way to a goal that stays, without costing more in simulation."""
        if self.settings.coarse is not None:
            return self.settings.coarse
        if not self.simulation.spec.pulses:
            return 0.0
        found = []
        for coarse in _COARSE:
            self.task = self.task._replace(commands=self.task.commands._replace(coarse=coarse))
            made = self.validate(self.settings.validation_movements)
            found.append((made.reward.mean(), made.success.mean()))
        self.task = self.task._replace(commands=self.task.commands._replace(coarse=0.0))
        rewards, settled = np.array(found).T
        good = (rewards >= rewards.max() * (1 + _COSTS_NOTHING)) & (settled >= settled.max() - _COSTS_NOTHING)
        return max(coarse for coarse, enough in zip(_COARSE, good, strict=True) if enough) if good.any() else 0.0

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Return all that its future depends on, by name."""
        net = {f"net.{name}": getattr(self.net, name) for name in ("flat", "mean", "square")}
        return {**net, "updates": self.updates, "states": self.tape.x[-1]}

    def _update(self) -> float:
        """Move and learn once; return the mean price of a step."""
        wanted, number = self.settings, int(self.updates[0])
        random = np.random.default_rng([self._seed, _MOVEMENTS, self._number, number])
        fresh = random.random(wanted.arms) < _RENEWED
        self._prepare(random, fresh if number else np.ones(wanted.arms, bool))
        price = learn_once(self._task_now(), self.net, self.tape)
        self.updates += 1
        adam(self.net, wanted.learning_rate * (1 - number / wanted.updates), wanted.largest_gradient, number + 1)
        return price

    def _task_now(self) -> ServoTask:
        """Return the task of this update.

        The price of changes rises, because who pays for them first never learns to move. Derivatives are cut off
        later and later: a policy that makes arms swing has none that are of use from far away. How late in the end is
        another question on an arm that is hard to keep from swinging than on a slow one.
        """
        paid, share = (1.0, 1.0) if self.price_all_along else (min(self.share / _FREE, 1.0), self.share)
        turn = self._number + self._number // 2  # of four agents every pair is one of stiffness and limit
        rise = _STEEPEST_LAST[turn % len(_STEEPEST_LAST)] / _STEEPEST
        return self.task._replace(
            commands=self.task.commands._replace(coarse=0.0),  # a policy that learns with coarse ones does worse
            prices=self.task.prices._replace(change=paid * self.task.prices.change),
            steepest=_STEEPEST * rise**share * USUAL_PERIOD / self.simulation.spec.period,
        )

    def _angles(self, step: int) -> NDArray[np.float32]:
        """Return the angles at a step on the tape, shape (joints, n) [scaled]."""
        return self.tape.x[step, 0 : 4 * self.simulation.window.joints : 4]

    def _counts(self, angle: NDArray[np.float32]) -> NDArray[np.float64]:
        """Return scaled angles (..., joints, n) in counts."""
        window, scaling = self.simulation.window, self.simulation.scaling
        offset, scale = window.of_joints(scaling.observation_offset), window.of_joints(scaling.observation_scale)
        return angle * scale[:, :1] + offset[:, :1]

    def _valve_changes(self) -> NDArray[np.int64]:
        """Return how often valves opened or closed in the movements on the tape, shape (joints, n)."""
        window = self.simulation.window
        first = window.state_size
        command = self.tape.x[:-1, first : first + window.command_size]
        return valve_changes(command).reshape(window.joints, 2, -1).sum(axis=1)

    def _prepare(self, random: np.random.Generator, fresh: NDArray[np.bool_]) -> None:
        """Put states, noise, references and previews of the next movements on the tape; ``fresh`` begin at rest."""
        tape, wanted, simulation = self.tape, self.settings, self.simulation
        window, scaling = simulation.window, simulation.scaling
        n, size, steps = wanted.arms, window.state_size, len(tape.slope)
        tape.x[0, :size] = tape.x[-1, :size]
        chosen = self._begin.states[random.integers(len(self._begin), size=int(fresh.sum()))]
        tape.x[0, :size, fresh] = chosen
        tape.x[0, window.input_size + window.joints] = 1
        scale = window.of_joints(scaling.observation_scale)
        noise = wanted.reading_noise * simulation.error_std[:, [0, 2, 3]] / scale[:, [0, 2, 3]]
        tape.noise[...] = random.standard_normal(tape.noise.shape, np.float32) * noise.reshape(-1, 1)
        ahead = self.task.inputs.steps
        drawn = draw_references(
            random,
            simulation.goals,
            self._counts(self._angles(0)),
            steps + 1 + int(ahead.max()),
            simulation.spec,
            _FASTEST * 1e3 * scale[:, 1],
        )
        offset = window.of_joints(scaling.observation_offset)
        reference = ((drawn - offset[:, :1]) / scale[:, :1]).astype(np.float32)
        tape.reference[...] = reference[: steps + 1]
        write_previews(reference, ahead, random.random(n) < wanted.known, tape.preview)
