"""The inverse simulation: where an arm may have come from (thesis section 4.4).

    (o_{k+1}, a_k) -> o_k                                                                         (thesis eq. 4.17)

It is fitted as a simulation is, to the same transitions turned round. For some actions there is no such state: a
muscle that is full cannot just have let air out. A network has an answer all the same. So an action counts as
possible only where it was recorded to lead to about such an observation: at most as far away as the nearest ones are
from nearly all observations that were held out. Pulses are fitted, but never possible: each is recorded too rarely.

Difference from the thesis: states are single observations. Those of several steps overlap, so eq. 4.17 would have to
find nothing but the oldest observation in them.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.seam import ArmSpec
from pneumarm.extras import extra
from pneumarm.simulation.fit import FitSettings, fit
from pneumarm.simulation.simulation import Simulation
from pneumarm.transitions.choice import choose_held_out
from pneumarm.transitions.filtering import filter_transitions
from pneumarm.transitions.store import Store
from pneumarm.transitions.window import Transitions, Window

SETTINGS = FitSettings(history=1, memory=1, layers=1, velocity="network", ahead=0.0, spread=False)
"""How it is fitted: to single steps, each from one observation, with a network for the velocity."""
_NEARLY_ALL = 0.98


@dataclass(frozen=True)
class InverseSimulation:
    """A step backward, and what was recorded."""

    backward: Simulation
    """Predicts what was before."""
    recorded: Mapping[tuple[float, ...], Any]
    """Scaled observations that followed each command."""
    reach: float
    """Distance up to which a scaled observation is about as one that was recorded."""

    def before(self, after: NDArray[np.float64], command: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the observations before ``after``, (n, observation_size) [sensor units], if ``command`` led there.

        The ``command`` (command_size,) is the same for all.
        """
        return self.backward.predict(np.column_stack([after, np.tile(command, (len(after), 1))]))

    def is_possible(self, after: NDArray[np.float64], command: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return to which of the observations ``after`` (n, observation_size) the ``command`` can have led."""
        tree = self.recorded.get(tuple(command.tolist()))
        if tree is None:
            return np.zeros(len(after), bool)
        distance, _ = tree.query(self.scaled(after), distance_upper_bound=self.reach)
        return np.isfinite(distance)

    def scaled(self, observations: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return ``observations`` (n, observation_size) scaled."""
        return _scaled(self.backward, observations)


def nearest(points: NDArray[np.float64]) -> Any:
    """Return a k-d tree of ``points`` (n, size), which finds the nearest of them.

    Raises:
        UnusableInput: SciPy is not installed.

    """
    return extra("scipy.spatial", "inverse", "the inverse simulation").KDTree(points)


def turned_round(transitions: Transitions) -> Transitions:
    """Return ``transitions`` of single observations with what was before as their target (thesis eq. 4.17)."""
    commands = transitions.inputs[:, transitions.target.shape[1] :]
    inputs = np.concatenate([transitions.target, commands], axis=1)
    return transitions._replace(inputs=inputs, target=transitions.observation)


def fit_inverse(
    training: Transitions, held_out: Transitions, spec: ArmSpec, goal_range: NDArray[np.float64], seed: int = 0
) -> InverseSimulation:
    """Return the inverse simulation fitted to ``training``, with errors on ``held_out``, both of single observations.

    Raises:
        UnusableInput: the transitions are too few, or of longer windows.

    """
    settings = FitSettings(**{**vars(SETTINGS), "seed": seed})
    one, other = turned_round(training), turned_round(held_out)
    backward = fit(one, other, spec=spec, goal_range=goal_range, settings=settings).simulation
    recorded = {tuple(command.tolist()): nearest(after) for command, after in _by_command(backward, training)}
    distances = [
        recorded[tuple(command.tolist())].query(after)[0]
        for command, after in _by_command(backward, held_out)
        if tuple(command.tolist()) in recorded
    ]
    return InverseSimulation(backward, recorded, float(np.quantile(np.concatenate(distances), _NEARLY_ALL)))


def inverse_of(store: Store, seed: int = 0) -> InverseSimulation:
    """Return the inverse simulation fitted to what ``store`` holds.

    Raises:
        UnusableInput: the store holds too little.

    """
    store = store.drawn()
    window = Window.of(store.spec, 1)
    share, _ = choose_held_out(store, SETTINGS.held_out, seed, window.history)
    filtered = filter_transitions(store, window, seed=seed, hold_out=share)
    apart = [np.concatenate(columns) for columns in zip(*filtered.stream("held-out"), strict=True)]
    return fit_inverse(filtered.transitions, Transitions(*apart), store.spec, store.percentiles(), seed)


def _scaled(simulation: Simulation, observations: NDArray[np.floating]) -> NDArray[np.float64]:
    scaling = simulation.scaling
    scaled: NDArray[np.float64] = (observations - scaling.observation_offset) / scaling.observation_scale
    return scaled


def _by_command(
    simulation: Simulation, transitions: Transitions
) -> list[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Return each command of whole periods (command_size,) and the scaled observations after it, (n, size)."""
    given = transitions.inputs[:, transitions.target.shape[1] :].astype(np.float64)
    whole = (given == np.rint(given)).all(axis=1)
    commands, which = np.unique(given[whole], axis=0, return_inverse=True)
    after = _scaled(simulation, transitions.target[whole])
    return [(command, after[which.ravel() == place]) for place, command in enumerate(commands)]
