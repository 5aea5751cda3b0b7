"""What a servo is to do, for kernels, and the sizes of the network that does it."""

import numpy as np

from pneumarm.learning.servo.commands import command_parameters, shortest_share
from pneumarm.learning.servo.gradient import ServoTask
from pneumarm.learning.servo.inputs import input_size, seen_parameters
from pneumarm.learning.servo.settings import SOFT, USUAL_PERIOD, ServoSettings
from pneumarm.simulation.kernel import simulation_parameters
from pneumarm.simulation.simulation import Simulation
from pneumarm.task.price import PriceParameters

_PAST_THE_LIMIT = 0.2  # share of the gradient, see ServoTask


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
