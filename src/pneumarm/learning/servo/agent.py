"""A trained servo and its file, which holds all it needs to act; and the servo as a controller."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from pneumarm.learning.network_agent import NetworkAgent
from pneumarm.learning.servo.actor import ServoActor
from pneumarm.learning.servo.commands import command_parameters, shortest_share
from pneumarm.learning.servo.controller import ServoController, ready_controller
from pneumarm.learning.servo.gradient import ServoTask
from pneumarm.learning.servo.inputs import input_size, seen_parameters
from pneumarm.learning.servo.predictive import PLANS, PredictiveControl
from pneumarm.learning.servo.settings import SOFT, STIFF, USUAL_PERIOD, ServoSettings
from pneumarm.learning.servo.testing import run_servo
from pneumarm.networks.layers import trainable
from pneumarm.simulation.kernel import simulation_parameters
from pneumarm.simulation.simulation import Simulation
from pneumarm.task.begin import BeginStates
from pneumarm.task.movements import Movement, Movements
from pneumarm.task.price import PriceParameters, prices_of_errors

KIND = "pneumarm servo"
_PAST_THE_LIMIT = 0.2  # share of the gradient, see ServoTask


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
        from pneumarm.learning.servo.training import tuned_servo  # which imports this module

        tuned = replace(self.settings, updates=updates, learning_rate=learning_rate)
        return self.revised(simulation, tuned_servo(self.policy, simulation, begin, tuned, seed))

    def stiffer(self) -> Self:
        """Return the servo to keep :data:`.STIFF` of the range of pressures where it learns on.

        One of which another stiffness than the usual :data:`.SOFT` was asked for stays as it is.
        """
        wanted = self.settings.stiffness
        return replace(self, settings=replace(self.settings, stiffness=STIFF if wanted in (None, SOFT) else wanted))

    def anew(self, simulation: Simulation, begin: BeginStates, seed: int) -> Self:
        """Return the servo trained from the beginning in ``simulation``; how coarse its commands are stays."""
        from pneumarm.learning.servo.training import train_servo  # which imports this module

        return self.revised(simulation, train_servo(simulation, begin, self.settings, seed).agent.policy)


def servo_task(simulation: Simulation, settings: ServoSettings) -> ServoTask:
    """Return what does not change while a servo learns or acts."""
    change = price_of_a_change(simulation, settings)
    window, scaling = simulation.window, simulation.scaling
    offset, scale = (window.of_joints(one)[:, 2:] for one in (scaling.observation_offset, scaling.observation_scale))
    lowest, highest = np.moveaxis(simulation.pressure_range, -1, 0)
    both = float(simulation.spec.muscles > 1)  # one muscle has the pressure of its angle
    shortest = shortest_share(simulation.spec)
    return ServoTask(
        simulation=simulation_parameters(simulation),
        inputs=seen_parameters(simulation, settings.preview, settings.tolerance),
        commands=command_parameters(simulation, settings.dead, shortest, settings.coarse or 0.0),
        prices=PriceParameters(
            precision=settings.precision,
            far=settings.far,
            flat=settings.flat,
            change=change,
            slack=both * settings.slack,
            cocontraction=both * settings.cocontraction,
            stiffness=SOFT if settings.stiffness is None else settings.stiffness,
        ),
        lowest=((lowest - offset) / scale).astype(np.float32),
        to_share=(scale / np.maximum(highest - lowest, 1e-9)).astype(np.float32),
        past_the_limit=_PAST_THE_LIMIT,
        steepest=1e9,
    )


def price_of_a_change(simulation: Simulation, settings: ServoSettings) -> float:
    """Return what opening or closing a valve costs, in errors of a control period.

    Errors cost by the step: at a higher rate there are more of them in a second, and a change must cost as much more.
    """
    return settings.change * USUAL_PERIOD / simulation.spec.period


def servo_sizes(simulation: Simulation, settings: ServoSettings) -> tuple[int, ...]:
    """Return the units of each layer of the policy, inputs first."""
    inputs = seen_parameters(simulation, settings.preview, settings.tolerance)
    return (input_size(inputs), *settings.hidden, 2 * simulation.window.joints)
