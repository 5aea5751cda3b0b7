"""Fitting a simulation to transitions (thesis section 3.2.4), and its errors on transitions it was not fitted to.

Numbered difference from the thesis: (1) fits go on for up to 60 epochs where the thesis stopped at 15. On the nominal
virtual arm (200,000 transitions, held-out sequences) that takes the standard deviation of the error of the angle from
3.14 to 2.73 counts, of the velocity from 0.087 to 0.077 counts/ms, and of the pressures from 1.35 to 1.21 counts.
"""

import os
import time
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from typing import Annotated, Any, Literal, NamedTuple, Self

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from pneumarm.arm.seam import ArmSpec, SensorKind
from pneumarm.errors import UnusableInput
from pneumarm.networks import (
    Fit,
    Importance,
    LevenbergMarquardt,
    Network,
    gradient_descent,
    least_squares,
    levenberg_marquardt,
    nguyen_widrow,
    two_layers,
)
from pneumarm.networks import importance as importance_of
from pneumarm.settings import (
    NonNegativeFloat,
    NonNegativeInt,
    PositiveFloat,
    PositiveInt,
    PythonOnly,
    Settings,
    Valid,
)
from pneumarm.simulation.ahead import fitted_ahead, stretches
from pneumarm.simulation.history import LONGEST, SEEN, USUAL, chosen_history, columns
from pneumarm.simulation.quality import Statistics, statistics
from pneumarm.simulation.simulation import Commands, Scaling, Simulation, Velocity
from pneumarm.simulation.spread import spread_over_periods
from pneumarm.transitions.choice import Stretched, choose_held_out, held_out, picked, stretch_of
from pneumarm.transitions.collect import FEWEST_TRANSITIONS
from pneumarm.transitions.filtering import Filtered, filter_transitions
from pneumarm.transitions.goals import held_range, seen_goals
from pneumarm.transitions.grid import GridSettings
from pneumarm.transitions.hysteresis import RADII
from pneumarm.transitions.rows import Rows
from pneumarm.transitions.store import Store
from pneumarm.transitions.window import QUANTITIES, Transitions, Window

_LARGEST_EPOCH = 3e10
"""Rows times weights squared; more than 500,000 rows of one joint, and 48,000 of two."""
_ROWS_A_WEIGHT = 20
"""Rows that a network is fitted to at least, for each of its weights, where there are so many."""
_FEWEST_A_WEIGHT = 8
"""Rows for each of its weights without which a network reads no more than the usual observations."""
_AGAIN = 0.25
"""Share of the epochs in which it is taught what pulses do on average where none were recorded."""
_EPOCHS_ON = 20
"""Epochs, or passes, of a fit that goes on from where another ended."""
HIDDEN, _HIDDEN_OF_TWO = 10, 32
"""Hidden units of each layer for each joint, of networks with one layer and with two."""
_NEWEST_COUNT = 5
"""Times that movements of an agent count in a fit that goes on, beside what was recorded before."""
_ROWS_FOR_TWO = 5_000
"""Rows for each joint from which on two layers are as good as one, or better."""
_PASSES, _ROWS_OF_PASSES = 2400, 48_000_000
"""Most passes of gradient descent over all rows, and most rows of all passes together, in all epochs."""
_SHARE_BEFORE_AHEAD = 0.5
"""Share of the passes that is as good where predictions are fitted ahead afterwards."""
_BATCH, _BATCH_ON = 256, 64
"""Rows of a step of gradient descent, and of one that goes on from where another ended."""
_RATE, _RATE_ON = 1e-2, 1e-3
"""Likewise its learning rate."""
_EPOCHS_AHEAD = 10
"""Epochs of each network that fitting ahead takes about as long as."""
_ROWS = 7  # stream of random numbers
_MARGIN = 0.05
"""Predicted pressures may exceed the recorded ones by this part of their range."""


@dataclass(frozen=True)
class FitSettings(Settings):
    """What a person may choose of a fit."""

    history: PositiveInt | None = None
    """Observations that the networks read (thesis eq. 3.5: 3); by default 3, or more where more say more of this
    arm."""
    memory: PositiveInt | None = None
    """Observations in the state, for a policy to see; by default 8 or more where predictions are fitted ahead, for
    agents that settle, and else no more than the networks read (thesis)."""
    hysteresis: tuple[PositiveFloat, ...] | None = None
    """Radii of stop operators, by which the state remembers how a joint came to where it is [degrees]; by default 1
    and 5 where predictions are fitted ahead, for agents that settle, and else none (thesis)."""
    approximator: Literal["network", "least-squares"] = "network"
    """Function approximator: a network (thesis), or a linear model by least squares."""
    layers: Literal[1, 2] | None = None
    """Hidden layers (thesis: 1). With 2, one network has all outputs, and is fitted by gradient descent; by default
    with several joints, where there are 5,000 rows for each."""
    hidden: Annotated[int, Meta(ge=1, le=1000)] | None = None
    """Hidden units of each layer for each joint of the arm; by default 10 (thesis: 10, one joint), or 32 of two
    layers."""
    epochs: PositiveInt = 60
    """Epochs of Levenberg-Marquardt at most (thesis: 15); with two layers 40 passes each of gradient descent,
    and half of them before a fit ahead."""
    tolerance: Annotated[float, Meta(ge=0, lt=1)] = 1e-5
    """A fit ends early when three epochs in a row lower its error by less than this part; 0: never."""
    decay: Annotated[NonNegativeFloat, PythonOnly] = 0.0
    """Weight decay (thesis: 0)."""
    ahead: Annotated[float, Meta(ge=0, le=10)] = 0.4
    """How far ahead predictions are fitted [s], after those of single steps; 0: not at all (thesis), which suits
    agents that are to reach goals."""
    spread: bool = True
    """Whether, where valves were recorded for whole periods alone, it is taught what pulses would do on average: the
    default agent learns by pulses. Agents that are to reach goals need none."""
    one_network: bool = False
    """One network with all outputs in place of one an output (the alternative in thesis section 3.4)."""
    velocity: Velocity = "derived"
    """Velocity derived from the predicted angle (thesis), or by a network of its own, as one that is measured always
    is."""
    sensors: tuple[SensorKind, ...] = ()
    """Further sensors of the arm whose readings belong to the state: velocity in place of the derived one,
    acceleration, temperature (thesis section 7.3 and appendix A; there: none)."""
    held_out: Annotated[float, Meta(gt=0, lt=1)] = 0.1
    """Share of the sequences that is kept out of the fit, to measure its errors on; at least one sequence in which
    the arm moves. Where too few do, stretches within sequences are held out."""
    seed: NonNegativeInt = 0
    """Random seed of initial weights and of every other random choice."""
    grid: GridSettings = field(default_factory=GridSettings)
    """The grid by which the recording is filtered."""

    def _valid(self) -> Valid:
        return {"sensors": len(set(self.sensors)) == len(self.sensors) or "each of them once"}

    def of_single_steps(self) -> "FitSettings":
        """Return the settings for agents that are to reach goals, unless something else than usual is asked for."""
        usual = (self.ahead, self.spread) == (FitSettings.ahead, FitSettings.spread)
        return replace(self, ahead=0.0, spread=False) if usual else self

    def of_arm(self, store: Store) -> "FitSettings":
        """Return the settings with the history and memory that suit the arm of ``store`` where none is asked for."""
        history = self.history or min(chosen_history(store, store.spec, self.sensors), self._longest(store))
        settles = self.ahead > 0 and self.approximator == "network"
        return replace(
            self,
            history=history,
            memory=self.memory or max(history, SEEN if settles else 1),
            hysteresis=(RADII if settles else ()) if self.hysteresis is None else self.hysteresis,
        )

    def with_layers(self, joints: int, rows: int) -> "FitSettings":
        """Return the settings with what suits ``joints`` and ``rows`` where no layers or hidden units are chosen."""
        several = joints > 1 and self.approximator == "network"
        enough = rows >= _ROWS_FOR_TWO * joints
        if (self.layers or (2 if several and enough else 1)) == 1:
            return replace(self, layers=1, hidden=self.hidden or HIDDEN)
        return replace(self, layers=2, hidden=self.hidden or _HIDDEN_OF_TWO, one_network=True)

    def _longest(self, store: Store) -> int:
        """Return how many observations networks may read that are fitted to ``store``, in sound time."""
        for history in range(LONGEST, USUAL, -1):
            weights = _weights(Window.of(store.spec, history, self.sensors).input_size, self, store.joints)
            if store.transitions >= _FEWEST_A_WEIGHT * weights and store.transitions * weights**2 <= _LARGEST_EPOCH:
                return history
        return USUAL

    @property
    def observations(self) -> int:
        """Observations in the state."""
        return max(self.history or USUAL, self.memory or 0)


SINGLE_STEPS = FitSettings().of_single_steps()
"""As in the thesis: fitted to one step after the other, each for itself, and to what was recorded alone."""


class FitResult(NamedTuple):
    """A fitted simulation and how good it is."""

    simulation: Simulation
    held_out: Statistics
    """One-step errors on sequences that were kept out of the fit."""
    training: Statistics
    """One-step errors on the transitions that were fitted."""
    generalisation: Statistics | None
    """One-step errors on the generalisation set of thesis section 3.3, where there is one."""
    importance: Importance
    """Weights of a linear fit to the same changes, whichever approximator was chosen."""
    outputs: list[str]
    """What each curve, and each column of the importance, is a change of."""
    curves: list[NDArray[np.float64]]
    """Mean squared error before and after every epoch in units of the change's standard deviation squared, one
    curve a network; none for least squares. Where no pulses were recorded those of the second round of fits, to what
    they do on average too (:mod:`pneumarm.simulation.spread`)."""
    converged: list[bool]
    """Whether each network's fit ended before its epochs were used up."""
    rows: int
    """Transitions that were fitted."""
    seconds: float
    """Duration of the fits alone, without the errors."""
    used: Sequence[str] = ()
    """What to tell a person where not all of a store was used."""

    @property
    def std(self) -> dict[str, Any]:
        """Standard deviation of the one-step error on held-out sequences (eq. 3.6): a number, or one a joint."""
        return by_quantity(self.held_out.std, self.simulation.window.further)

    @property
    def relative_error(self) -> dict[str, Any]:
        """``std`` over the standard deviation of the one-step change; None where that is 0."""
        return by_quantity(self.held_out.relative, self.simulation.window.further)

    @property
    def remarks(self) -> list[str]:
        """What to tell a person of the fit."""
        return [*self.used, *remarks(self.held_out, self.simulation)]


def by_quantity(values: NDArray[np.float64], further: Sequence[str] = ()) -> dict[str, Any]:
    """Return ``values`` (observation_size,) as numbers by the names of quantities; lists where there are more joints.

    What belongs to ``further`` sensors comes last, by their names. What is NaN is None.
    """
    numbers = values.astype(object)
    numbers[np.isnan(values)] = None
    joints = len(values) - len(further)
    columns = zip(QUANTITIES, numbers[:joints].reshape(-1, len(QUANTITIES)).T.tolist(), strict=True)
    named = {name: column[0] if len(column) == 1 else column for name, column in columns}
    return named | dict(zip(further, numbers[joints:].tolist(), strict=True))


def remarks(errors: Statistics, simulation: Simulation) -> list[str]:
    """Return what to tell a person of one-step errors: of what nothing can be said, and what is useless."""
    window = simulation.window
    names = [name.removesuffix("[k]").replace("_", " ") for name in window.input_names()[: window.observation_size]]
    there = np.ones(len(names), np.bool_)
    there[simulation.outputs[~simulation.measured]] = False
    still = [name for name, one, used in zip(names, errors.change_std, there, strict=True) if used and one == 0]
    lines = []
    if still:
        lines.append(
            f"nothing can be said of the error of {', '.join(still)}: it never changes in what was held out of the "
            "fit; record more in which it does"
        )
    return lines + [
        f"the one-step error of {name} is {error:.2g} times its change: worse than saying that nothing changes; look "
        "at what was recorded, or record more"
        for name, error, used in zip(names, errors.relative, there, strict=True)
        if used and error > 1
    ]


def fit(
    training: Transitions,
    held_out: Transitions | Iterable[Transitions],
    *,
    spec: ArmSpec,
    goal_range: NDArray[np.float64],
    valves: bool = True,
    generalisation: Transitions | Iterable[Transitions] | None = None,
    recorded: Iterable[Rows] = (),
    settings: FitSettings | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> FitResult:
    """Fit a simulation to the ``training`` transitions and measure its errors on the others.

    Args:
        training: the filtered transitions (thesis section 3.2.3), with windows of ``settings.history`` and of
            ``settings.sensors``.
        held_out: transitions of other sequences, at once or in blocks.
        spec: the arm they are of.
        goal_range: 1st and 99th percentile of the stored angles, (joints, 2) [counts].
        valves: whether the commands are those of on/off valves.
        generalisation: transitions that the filter left out (section 3.3), at once or in blocks.
        recorded: rows of whole sequences, those that are not held out being fitted over several steps.
        settings: what a person may choose.
        progress: called as ``progress(epochs done, epochs at most)``, over all networks together.

    Raises:
        UnusableInput: the transitions do not fit to ``spec`` and ``settings``, or are too few.

    """
    settings = (settings or FitSettings()).with_layers(spec.joints, len(training.inputs))
    window = _window(spec, settings)
    _check_transitions(training, window)
    began = time.perf_counter()
    simulation = _unfitted(training, spec, goal_range, valves, settings)
    read = columns(window, settings.history or USUAL)
    changes = _Changes.of(training, simulation, read)
    linear = least_squares(changes.inputs, changes.targets)
    fits: list[Fit] = []
    if settings.approximator == "least-squares":
        simulation = replace(simulation, networks=(linear.times(changes.factor).widened(read, window.input_size),))
    else:
        progress = progress or (lambda done, total: None)
        simulation, fits = _fitted_in_rounds(simulation, changes, training, recorded, settings, progress)
    seconds = time.perf_counter() - began
    errors = statistics(simulation, held_out)
    names = [name.removesuffix("[k]") for name in window.input_names()]
    outputs = [names[place] for place in simulation.outputs]
    inputs = [window.input_names()[one] for one in read]
    return FitResult(
        simulation=simulation.with_errors(errors.std),
        held_out=errors,
        training=statistics(simulation, training),
        generalisation=None if generalisation is None else statistics(simulation, generalisation),
        importance=importance_of(linear, changes.inputs, changes.targets, inputs, outputs),
        outputs=outputs,
        curves=[one.mse for one in fits],
        converged=[one.converged for one in fits],
        rows=len(training.inputs),
        seconds=seconds,
    )


def _check_transitions(training: Transitions, window: Window) -> None:
    """Raise UnusableInput where ``training`` has other windows, or too few transitions."""
    if training.inputs.shape[1] != window.input_size or training.target.shape[1] != window.observation_size:
        raise UnusableInput(
            f"expected transitions of {window.joints} joint(s) with a history of {window.history}, that is "
            f"{window.input_size} inputs, got {training.inputs.shape[1]}; make them with the same window"
        )
    if len(training.inputs) <= window.input_size:
        raise UnusableInput(
            f"{len(training.inputs)} transitions are too few to fit; collect at least {FEWEST_TRANSITIONS:,}"
        )


@dataclass(frozen=True)
class _Changes:
    """What networks are fitted to: how the outputs change in a step, in units of their spread."""

    inputs: NDArray[np.float32]
    """Scaled (rows, len(read))."""
    targets: NDArray[np.float64]
    """Changes, over their spread (rows, outputs)."""
    read: NDArray[np.int64]
    """Which inputs of the simulation these are."""
    spread: NDArray[np.float64]
    """Standard deviations of the changes, or 1 of those that are all the same (outputs,)."""
    factor: NDArray[np.float64]
    """The spreads in the simulation's units, which are those of its observations (outputs,)."""

    @classmethod
    def of(cls, training: Transitions, simulation: Simulation, read: NDArray[np.int64]) -> Self:
        """Return the changes in ``training``."""
        places = simulation.outputs
        change = training.target[:, places].astype(np.float64) - training.observation[:, places]
        spread = change.std(axis=0)
        spread[spread == 0] = 1.0
        factor = spread / simulation.scaling.observation_scale[places]
        return cls(_inputs(training.inputs, simulation, read), change / spread, read, spread, factor)


def _inputs(inputs: NDArray[Any], simulation: Simulation, read: NDArray[np.int64]) -> NDArray[np.float32]:
    return simulation.scaling.inputs(inputs, simulation.window).astype(np.float32)[:, read]


def _fitted_in_rounds(
    simulation: Simulation,
    changes: _Changes,
    training: Transitions,
    recorded: Iterable[Rows],
    settings: FitSettings,
    progress: Callable[[int, int], None],
) -> tuple[Simulation, list[Fit]]:
    """Return ``simulation`` with networks fitted to single steps, to several of them, and to pulses, as chosen."""
    networks = 1 if settings.one_network else changes.targets.shape[1]
    steps = round(settings.ahead / simulation.spec.period)
    spreads = settings.spread and simulation.commands == "valves"
    epochs_ahead = _EPOCHS_AHEAD if steps > 1 else 0
    epochs_again = max(1, round(_AGAIN * settings.epochs)) if spreads else 0
    total = networks * (settings.epochs + epochs_ahead + epochs_again)

    def after(epochs: int) -> Callable[[int, int], None]:
        return lambda done, _: progress(networks * epochs + done, total)

    simulation, fits = _fitted(simulation, changes, settings, after(0))
    if steps > 1:
        report, units = after(settings.epochs), networks * epochs_ahead
        long_enough = stretches(recorded, simulation, steps)
        simulation = fitted_ahead(
            simulation, long_enough, settings.seed, lambda share: report(int(share * units), units)
        )
        report(units, units)
    if spreads:
        with_pulses = _with_pulses(simulation, changes, training, settings.seed)
        before = after(settings.epochs + epochs_ahead)
        simulation, fits = _fitted(simulation, with_pulses, replace(settings, epochs=epochs_again), before)
        simulation = replace(simulation, spread=True)
    return simulation, fits


def _with_pulses(simulation: Simulation, changes: _Changes, training: Transitions, seed: int) -> _Changes:
    """Return the changes that ``simulation`` predicts, and beside them what pulses do on average."""
    pulses = spread_over_periods(simulation, training, seed)
    inputs = np.concatenate([training.inputs, pulses.inputs])
    following = np.concatenate([simulation.predict(training.inputs), pulses.target])
    change = (following - inputs[:, : simulation.window.observation_size])[:, simulation.outputs]
    return replace(changes, inputs=_inputs(inputs, simulation, changes.read), targets=change / changes.spread)


def _fitted(
    simulation: Simulation, changes: _Changes, settings: FitSettings, progress: Callable[[int, int], None]
) -> tuple[Simulation, list[Fit]]:
    """Return ``simulation`` with networks fitted to ``changes``, from where its own are, or from random ones."""
    joints, size = simulation.window.joints, simulation.window.input_size
    x, y, read = changes.inputs, changes.targets, changes.read
    targets = [y] if settings.one_network else [y[:, [i]] for i in range(y.shape[1])]
    factors = np.split(changes.factor, len(targets))
    before = [one.times(1 / each).reading(read) for one, each in zip(simulation.networks, factors, strict=False)]
    if settings.layers == 2:
        starts: list[Network | None] = list(before) or [None] * len(targets)
        fits = [_fit_two_layers(x, *pair, settings, joints, progress) for pair in zip(targets, starts, strict=True)]
    else:
        chosen = _rows_to_fit(len(x), _weights(x.shape[1], settings, joints), settings.seed)
        seen = [_seen_by(simulation, outputs, read) for outputs in np.split(simulation.outputs, len(targets))]
        fits = _fit_networks(x[chosen], [one[chosen] for one in targets], seen, settings, joints, progress, before)
    still = np.ptp(x, axis=0) == 0
    networks = [
        _without(one.network, still).times(scale).widened(read, size)
        for one, scale in zip(fits, factors, strict=True)
    ]
    return replace(simulation, networks=tuple(networks)), fits


def _unfitted(
    training: Transitions, spec: ArmSpec, goal_range: NDArray[np.float64], valves: bool, settings: FitSettings
) -> Simulation:
    """Return the simulation without its networks."""
    window = _window(spec, settings)
    return Simulation(
        spec=_widened(window.spec(spec), window, training),
        window=window,
        scaling=Scaling.of(training, window, valves),
        networks=(),
        velocity="network" if window.velocity == "measured" else settings.velocity,
        error_std=np.zeros((spec.joints, len(QUANTITIES))),
        goal_range=np.asarray(goal_range, np.float64).reshape(spec.joints, 2),
        pressure_range=_pressure_range(training, window),
        commands=_commands(training, window) if valves else "continuous",
        held_out=settings.held_out,
        seed=settings.seed,
        further_std=np.zeros(len(window.further)),
        further_range=_further_range(training, window),
    )


def _window(spec: ArmSpec, settings: FitSettings) -> Window:
    radii = tuple(one * spec.counts_per_degree for one in settings.hysteresis or ())
    return Window.of(spec, settings.observations, settings.sensors, radii)


def _commands(training: Transitions, window: Window) -> Commands:
    """Return what on/off valves were commanded."""
    command = training.inputs[:, -window.command_size :]
    return "valves" if ((command == 0) | (np.abs(command) == 1)).all() else "pulses"


def _seen_by(simulation: Simulation, outputs: NDArray[np.int64], read: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return which of the inputs ``read`` the network of these ``outputs`` sees: all, or all but stop operators.

    How a joint came to where it is decides on its torque, and on no pressure.
    """
    window = simulation.window
    pressures = (outputs < window.joint_size) & (outputs % len(QUANTITIES) >= QUANTITIES.index("pressure_1"))
    memory = range(window.state_size - window.memory_size, window.state_size)
    return np.flatnonzero(~np.isin(read, memory) if pressures.all() else np.ones(len(read), np.bool_))


def _fit_networks(
    x: NDArray[np.float32],
    targets: list[NDArray[np.float64]],
    seen: list[NDArray[np.int64]],
    settings: FitSettings,
    joints: int,
    progress: Callable[[int, int], None],
    before: Sequence[Network],
) -> list[Fit]:
    """Fit a network to each of ``targets``, on as many threads as there are cores: the work is in NumPy.

    ``seen`` are the columns of ``x`` that each reads.
    """
    solver = LevenbergMarquardt(epochs=settings.epochs, tolerance=settings.tolerance, decay=settings.decay)
    seeds = np.random.SeedSequence(settings.seed).generate_state(len(targets))
    done = [0] * len(targets)

    def one(number: int) -> Fit:
        def report(epoch: int, _: float) -> None:
            done[number] = epoch
            progress(sum(done), settings.epochs * len(targets))

        y, inputs = targets[number], seen[number]
        if before:
            start = before[number].reading(inputs)
        else:
            start = nguyen_widrow(len(inputs), _hidden(settings, joints), y.shape[1], int(seeds[number]))
        if not y.any():  # what never changed needs no fit
            start = replace(start, output_weights=np.zeros_like(start.output_weights))
            return Fit(start.widened(inputs, x.shape[1]), np.zeros(1), 0, converged=True)
        fitted = levenberg_marquardt(x[:, inputs], y, start, solver, report)
        return fitted._replace(network=fitted.network.widened(inputs, x.shape[1]))

    with ThreadPoolExecutor(min(len(targets), os.cpu_count() or 1)) as threads:
        return list(threads.map(one, range(len(targets))))


def _fit_two_layers(
    x: NDArray[np.float32],
    y: NDArray[np.float64],
    before: Network | None,
    settings: FitSettings,
    joints: int,
    progress: Callable[[int, int], None],
) -> Fit:
    """Fit a network of two hidden layers to ``y``; it begins as it was ``before``, or at random."""
    passes, rate, batch = min(_PASSES, -(-_ROWS_OF_PASSES // len(x))), _RATE, _BATCH
    if before is None:
        share = settings.epochs / FitSettings.epochs * (_SHARE_BEFORE_AHEAD if settings.ahead > 0 else 1)
        passes = max(1, round(passes * share))
    else:
        passes, rate, batch = min(_EPOCHS_ON, passes), _RATE_ON, _BATCH_ON
    start = before or two_layers(x.shape[1], _hidden(settings, joints), y.shape[1], settings.seed)

    def report(done: int, _: float) -> None:
        progress(round(done / passes * settings.epochs), settings.epochs)

    return gradient_descent(x, y, start, passes, rate, settings.seed, report, batch)


def _hidden(settings: FitSettings, joints: int) -> int:
    """Return how many hidden units a layer has."""
    return (settings.hidden or HIDDEN) * joints


def _weights(inputs: int, settings: FitSettings, joints: int) -> int:
    """Return how many weights a network with one hidden layer has, about."""
    return (inputs + 2) * _hidden(settings, joints)


def _rows_to_fit(rows: int, weights: int, seed: int) -> slice | NDArray[np.int64]:
    """Return which rows networks of so many ``weights`` are fitted to: all, unless an epoch would take too long.

    An epoch takes time in proportion to rows times weights squared.
    """
    most = max(_ROWS_A_WEIGHT * weights, int(_LARGEST_EPOCH / weights**2))
    if rows <= most:
        return slice(None)
    return np.sort(np.random.default_rng([seed, _ROWS]).choice(rows, most, replace=False))


def _without(network: Network, inputs: NDArray[np.bool_]) -> Network:
    """Return the network with no weight on those ``inputs`` (inputs,) that never varied; they are 0, scaled.

    Such are all of a muscle that is not there. A network is fitted as well with any weight on them, and begins with
    random ones.
    """
    if not inputs.any():
        return network
    return replace(network, hidden_weights=np.where(inputs[:, None], 0.0, network.hidden_weights))


def _widened(spec: ArmSpec, window: Window, transitions: Transitions) -> ArmSpec:
    """Return ``spec`` with an angle range that holds all recorded angles, about the same middle.

    Sensors go past their nominal ranges, and predictions are clipped to the range.
    """
    low, high = spec.angle_range
    angle = window.of_joints(transitions.target)[..., QUANTITIES.index("angle")]
    beyond = max(0.0, low - float(angle.min()), float(angle.max()) - high)
    return replace(spec, angle_range=(low - beyond, high + beyond))


def _pressure_range(transitions: Transitions, window: Window) -> NDArray[np.float64]:
    """Return the range that predicted pressures are clipped to, (joints, 2 muscles, 2) [counts].

    The recorded range gets a margin; but no gauge pressure lies below 0, unless the sensors said so.
    """
    pressure = window.of_joints(transitions.target)[..., -2:].astype(np.float64)
    least, highest = pressure.min(axis=0), pressure.max(axis=0)
    margin = _MARGIN * (highest - least)
    lowest = np.maximum(least - margin, np.minimum(least, 0.0))
    return np.stack([lowest, highest + _MARGIN * (highest - lowest)], axis=-1)


def _further_range(transitions: Transitions, window: Window) -> NDArray[np.float64]:
    """Return the range of what was recorded of further sensors, (further, 2) [sensor units].

    Where a thermometer never was there is no telling how the arm moves.
    """
    further = transitions.target[:, window.joint_size :].astype(np.float64)
    return np.stack([further.min(axis=0), further.max(axis=0)], axis=-1)


class StoreFit(NamedTuple):
    """A simulation fitted to a store, and what it was filtered from."""

    result: FitResult
    filtered: Filtered
    """The filtered set, its coverage, and the parts that were not fitted, to be streamed again."""

    @property
    def simulation(self) -> Simulation:
        """The simulation."""
        return self.result.simulation

    def __repr__(self) -> str:
        relative = self.result.relative_error.items()
        errors = ", ".join(f"{name} {np.round(np.array(value, np.float64), 3)}" for name, value in relative)
        return f"<StoreFit of {self.simulation!r}; relative one-step errors: {errors}>"

    def results(self) -> dict[str, Any]:
        """Return the figures of the fit as ``results.json`` and ``fit --json`` hold them."""
        result, apart, further = self.result, self.result.generalisation, self.simulation.window.further
        return {
            "std": result.std,
            "relative_error": result.relative_error,
            "training_std": by_quantity(result.training.std, further),
            "generalisation_std": None if apart is None else by_quantity(apart.std, further),
            "rows": result.rows,
            "epochs": [len(curve) - 1 for curve in result.curves],
            "seconds": result.seconds,
        } | ({"remarks": result.remarks} if result.remarks else {})


def fit_store(
    store: Store,
    settings: FitSettings | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> StoreFit:
    """Filter the transitions of ``store``, fit a simulation to them, and measure its errors on the others.

    Memory holds the filtered set; the rest is streamed. Of a large store a part is used (:meth:`Store.drawn`).

    Raises:
        UnusableInput: fewer than 1,000 transitions are stored, or no sequence is held out.

    """
    settings, store = settings or FitSettings(), store.drawn()
    if store.transitions < FEWEST_TRANSITIONS:
        marked = "".join(f"; {count:,} rows are marked: {reason}" for reason, count in store.marked_rows().items())
        raise UnusableInput(
            f"{store.transitions} transitions are too few to fit; collect at least {FEWEST_TRANSITIONS:,}{marked}"
        )
    window = Window.of(store.spec, 1, settings.sensors)
    window.require(store.further, str(store.address))
    settings = settings.of_arm(store)
    window = _window(store.spec, settings)
    share, stretch = choose_held_out(store, settings.held_out, settings.seed, window.history)
    settings, source = replace(settings, held_out=share), Stretched(store, stretch)
    filtered = filter_transitions(source, window, settings.grid, seed=settings.seed, hold_out=share)
    coverage = filtered.coverage
    result = fit(
        filtered.transitions,
        filtered.stream("held-out"),
        spec=store.spec,
        goal_range=_goal_range(store),
        valves=store.valves,
        generalisation=filtered.stream("generalisation") if coverage.kept < coverage.seen else None,
        recorded=source,
        settings=settings,
        progress=progress,
    )
    goals = seen_goals(store.blocks, result.simulation.goal_range)
    simulation = replace(result.simulation.with_goals(goals), stretch=stretch, grid=settings.grid)
    return StoreFit(result._replace(simulation=simulation, used=store.used), filtered)


def fitted_on(
    simulation: Simulation, store: Store, ahead: float = FitSettings.ahead, newest: Transitions | None = None
) -> Simulation:
    """Return ``simulation``, fitted on from where it is to all that ``store`` holds by now.

    Its window, scaling, ranges and goals stay, so that an agent of the one can act in the other. Its errors are those
    on sequences that are held out. ``ahead`` is how far ahead it is fitted [s]. The ``newest`` transitions in
    ``store``, made by an agent, so where it has to know most, count several times with two layers.
    """
    window, seed = simulation.window, simulation.seed
    layers: Literal[1, 2] = 1 if simulation.networks[0].second_weights is None else 2
    source = Stretched(store, simulation.stretch)
    filtered = filter_transitions(source, window, simulation.grid, seed=seed, hold_out=simulation.held_out)
    training = filtered.transitions
    if newest is not None and layers == 2:
        ends = newest.step - window.history, newest.step + 1  # of the rows that a transition is made of
        of = (stretch_of(newest.sequence, end, simulation.stretch) for end in ends)
        known = picked(newest, ~np.any([held_out(one, simulation.held_out, seed) for one in of], axis=0))
        parts = zip(training, *[known] * (_NEWEST_COUNT - 1), strict=True)
        training = Transitions(*(np.concatenate(part) for part in parts))
    one_network = len(simulation.networks) == 1
    fitted, _ = _fitted(
        simulation,
        _Changes.of(training, simulation, np.flatnonzero(simulation.reads)),
        FitSettings(epochs=_EPOCHS_ON, layers=layers, ahead=0.0, one_network=one_network, seed=seed),
        lambda done, total: None,
    )
    steps = round(ahead / simulation.spec.period)
    if steps > 1:
        fitted = fitted_ahead(fitted, stretches(source, fitted, steps), seed)
    return fitted.with_errors(statistics(fitted, filtered.stream("held-out")).std)


def _goal_range(store: Store) -> NDArray[np.float64]:
    """Return the range of angles that goals are drawn from, (joints, 2) [counts]."""
    seen = store.percentiles()
    return seen if store.spec.muscles == 2 else held_range(store.blocks, seen, store.spec.period)


def refiltered(store: Store, simulation: Simulation) -> Filtered:
    """Return the parts of ``store`` as they were when ``simulation`` was fitted to it, for an analysis.

    Raises:
        UnusableInput: the store is of another arm.

    """
    if store.joints != simulation.window.joints:
        raise UnusableInput(
            f"the store has {store.joints} joint(s), the simulation {simulation.window.joints}; "
            "give those that belong together"
        )
    source = Stretched(store.drawn(), simulation.stretch)
    apart = simulation.seed, simulation.held_out
    return filter_transitions(source, simulation.window, simulation.grid, seed=apart[0], hold_out=apart[1])
