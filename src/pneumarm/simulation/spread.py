"""What pulses do on average that are spread over whole periods: transitions that teach it to a simulation.

A servo learns by pulses, and where an arm has none they are spread over whole periods when it acts. A network fitted
to nothing but whole periods says anything in between, and a servo would learn to make use of that. On average a share
of whole periods does what follows from opening the valve for one with that probability.
"""

import numpy as np

from pneumarm.simulation.simulation import Simulation
from pneumarm.transitions.window import Transitions

_AS_THEY_ARE = 0.3
"""Share of the commands that are kept."""
_DRAWS = 8
"""Whole commands of which an average is taken."""
_STREAM = 8  # of random numbers


def spread_over_periods(simulation: Simulation, recorded: Transitions, seed: int) -> Transitions:
    """Return ``recorded`` transitions with pulses for commands, past ones too, and what they do on average.

    That is said by a ``simulation`` fitted to whole periods, asked for nothing else. There are as many transitions as
    were recorded, in sensor units as these; pulses are shares of the control period, -1 to 1.
    """
    window, random = simulation.window, np.random.default_rng([seed, _STREAM])
    commanded = window.commanded
    inputs = recorded.inputs.astype(np.float64)
    whole = inputs[:, commanded]
    kept = (random.random(whole.shape) < _AS_THEY_ARE) | ~whole.any(axis=0)  # a muscle that is not there has none
    pulses = np.where(kept, whole, random.uniform(-1.0, 1.0, whole.shape))
    following = np.zeros(recorded.target.shape)
    for _ in range(_DRAWS):
        inputs[:, commanded] = np.sign(pulses) * (random.random(pulses.shape) < np.abs(pulses))
        following += simulation.predict(inputs) / _DRAWS
    inputs[:, commanded] = pulses
    return recorded._replace(inputs=inputs.astype(np.float32), target=following.astype(np.float32))
