"""What the default agent computes all the time: sums of its networks, updates of its training, plans of a turn.

python -m benchmarks sums

Simulation and policy have the sizes of the defaults and random weights. Sums are compared with NumPy's product of the
same arrays; OMP_NUM_THREADS=1 makes that use one thread, too. Every time is the least of several, since other work on
the machine only adds to it.
"""

import time
from collections.abc import Callable, Iterator

import numpy as np

from benchmarks.environment import thesis_simulation
from pneumarm.learning.servo import ServoAgent, ServoSettings
from pneumarm.learning.servo.agent import ServoLearner
from pneumarm.networks.layers import weighted_sums

SIZES = (44, 48, 64), (44, 48, 8), (19, 32, 8)
"""Inputs, outputs and samples: of a policy while it learns and while it plans, of a simulation while it plans."""
_REPEATED = 15


def measure() -> Iterator[str]:
    random = np.random.default_rng(0)
    yield f"{'inputs':>8}{'outputs':>8}{'samples':>8}{'sums':>12}{'NumPy':>12}{'ratio':>8}"
    for inputs, outputs, samples in SIZES:
        weights, x = random.random((inputs, outputs), np.float32), random.random((inputs, samples), np.float32)
        out, across = np.zeros((outputs, samples), np.float32), np.ascontiguousarray(weights.T)
        ours = least(lambda w=weights, x=x, out=out: weighted_sums(w, x, out), 500)  # type: ignore[misc]
        theirs = least(lambda w=across, x=x, out=out: np.matmul(w, x, out=out), 500)  # type: ignore[misc]
        yield f"{inputs:8}{outputs:8}{samples:8}{ours * 1e6:9.2f} µs{theirs * 1e6:9.2f} µs{theirs / ours:8.2f}"
    simulation, begin = thesis_simulation()
    learner = ServoLearner(simulation, begin, ServoSettings(), 0, 0)
    yield f"an update of training: {least(learner._update, 5) * 1e3:.2f} ms"
    agent = ServoAgent(simulation, learner.net.flat.copy(), ServoSettings())
    plans = agent.predictive()
    assert plans is not None
    state, wanted = np.zeros(simulation.window.state_size, np.float32), np.full((1 + plans.ahead, 1), 500.0)
    wanted += 5 * np.arange(len(wanted))[:, None]
    yield f"plans of a turn: {least(lambda: plans.pulses(state, wanted), 10) * 1e3:.2f} ms"


def least(do: Callable[[], object], times: int) -> float:
    """Return the least time of one call [s], of several trials of so many ``times``."""
    do()
    found = []
    for _ in range(_REPEATED):
        began = time.perf_counter()
        for _ in range(times):
            do()
        found.append((time.perf_counter() - began) / times)
    return min(found)
