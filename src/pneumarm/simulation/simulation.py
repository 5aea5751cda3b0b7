"""The empirical simulation: networks fitted to transitions, and what is needed to use them (thesis chapter 3).

Numbered differences from the thesis:

1. The networks predict *changes* of angle and pressures, not the next values: these hardly change within a step, so a
   network of next values spends its first epochs on learning the identity. On the nominal virtual arm (200,000
   transitions, held-out sequences, mean of three seeds) the standard deviation of the error of the angle [counts] is
   2.97 instead of 3.17 after 15 epochs and 2.78 instead of 2.86 after 60; of the pressures 1.40 instead of 1.78, and
   1.26 instead of 1.30.
2. Predictions are clipped to what the sensors can say; pressures to a little above what was ever recorded.
"""

from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, Literal, Self

import msgspec
import numpy as np
from numpy.typing import ArrayLike, NDArray

from pneumarm.arm.seam import ArmSpec
from pneumarm.errors import UnusableInput
from pneumarm.files import read_arrays, write_arrays
from pneumarm.networks.network import Network
from pneumarm.transitions.goals import Goals
from pneumarm.transitions.grid import GridSettings
from pneumarm.transitions.window import QUANTITIES, Transitions, Window

Velocity = Literal["derived", "network"]

Commands = Literal["valves", "pulses", "continuous"]
"""Commands that transitions were recorded under: valves for whole periods, pulses too, or imported numbers."""

KIND = "pneumarm simulation 1"
_ANGLE, _VELOCITY = QUANTITIES.index("angle"), QUANTITIES.index("velocity")


@dataclass(frozen=True)
class Scaling:
    """Pre-processing: scaled = (raw - offset) / scale, so that the data lie within about -1 to 1."""

    observation_offset: NDArray[np.float64]
    """Shape (observation_size,) [sensor units]."""
    observation_scale: NDArray[np.float64]
    """Shape (observation_size,) [sensor units]."""
    command_scale: NDArray[np.float64]
    """Shape (2 joints,); ones for valves. Commands have no offset: 0 is a closed valve."""

    @classmethod
    def of(cls, transitions: Transitions, window: Window, valves: bool) -> Self:
        """Return the scaling that puts the mean of the observations at 0 and two standard deviations at 1."""
        observation = transitions.observation
        command = transitions.inputs[:, window.state_size :]
        return cls(
            observation_offset=observation.mean(axis=0, dtype=np.float64),
            observation_scale=_spread(observation),
            command_scale=np.ones(window.command_size) if valves else _spread(command),
        )

    def inputs(self, raw: ArrayLike, window: Window) -> NDArray[np.float64]:
        """Return the scaled inputs (n, input_size), or states (n, state_size), of ``raw`` ones in sensor units."""
        raw = np.asarray(raw, np.float64)
        radii = np.tile(np.array(window.hysteresis, np.float64), window.joints)
        offset = np.tile(self.observation_offset, window.history)
        scale = [*[self.observation_scale] * window.history, *[self.command_scale] * (window.history - 1), radii]
        scale += [self.command_scale] if raw.shape[-1] > window.state_size else []
        scaled: NDArray[np.float64] = raw / np.concatenate(scale)
        scaled[..., : len(offset)] -= offset / np.tile(self.observation_scale, window.history)
        return scaled


def _spread(values: NDArray[np.float32]) -> NDArray[np.float64]:
    """Return two standard deviations of each column, 1 where it never changes."""
    spread = 2 * values.std(axis=0, dtype=np.float64)
    return np.where(spread > 0, spread, 1.0)


@dataclass(frozen=True)
class Simulation:
    """A simulation of an arm: one step is ``o_{k+1} = o_k + networks(sigma_k, a_k)``.

    The networks read scaled inputs and give scaled *changes*, (o_{k+1} - o_k) / observation_scale, in the order
    angle, pressure 1, pressure 2 joint after joint; with ``velocity == "network"`` angle, velocity, pressure 1,
    pressure 2. What further sensors say comes last.
    """

    spec: ArmSpec
    window: Window
    scaling: Scaling
    networks: tuple[Network, ...]
    """One network an output, or a single network with all outputs (thesis section 3.4)."""
    velocity: Velocity
    """Whether the velocity is derived from the predicted angle with the nominal period (section 3.2.4); a measured
    one has a network."""
    error_std: NDArray[np.float64]
    """Standard deviation of the one-step error on held-out transitions, shape (joints, 4) [sensor units]."""
    goal_range: NDArray[np.float64]
    """1st and 99th percentile of the stored angles, shape (joints, 2) [counts]."""
    pressure_range: NDArray[np.float64]
    """Lowest and highest pressure that it predicts, shape (joints, 2 muscles, 2) [counts]."""
    commands: Commands = "valves"
    """What commands it was fitted to; with continuous ones no agent of ours can be trained."""
    spread: bool = False
    """Whether it was taught what pulses do on average, none being recorded (:mod:`pneumarm.simulation.spread`)."""
    held_out: float = 0.0
    """Share of the sequences that were kept out of the fit, chosen by :func:`pneumarm.transitions.held_out`."""
    stretch: int = 0
    """Where not whole sequences were held out, but stretches of them: the rows of these."""
    seed: int = 0
    """Of that choice, of the filter and of the fit, so that an analysis finds the same parts again."""
    grid: GridSettings = field(default_factory=GridSettings)
    """The grid that the recording was filtered by, likewise."""
    further_std: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))
    """As ``error_std``, of the further sensors in the window, shape (further,) [sensor units]."""
    further_range: NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 2)))
    """Lowest and highest readings that it predicts of further sensors, shape (further, 2) [sensor units]."""
    goal_ways: NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 0)))
    """Of :class:`~pneumarm.transitions.goals.Goals`, shape (k, joints) [1/counts]; empty where nothing is limited."""
    goal_limits: NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 2)))
    """Of the same, shape (k, 2)."""

    @property
    def goals(self) -> Goals:
        """Goals that the arm was seen to hold."""
        return Goals(self.goal_range, self.goal_ways.reshape(-1, self.window.joints), self.goal_limits)

    def with_goals(self, goals: Goals | ArrayLike) -> Self:
        """Return it with other goals, or with all within a range (joints, 2) [counts]."""
        found = Goals.of(goals)
        return replace(self, goal_range=found.range, goal_ways=found.ways, goal_limits=found.limits)

    def __repr__(self) -> str:
        ranges = ", ".join(f"{low:.0f} to {high:.0f} deg" for low, high in self.spec.degrees(self.goal_range))
        return f"<Simulation of {self.spec.name}, {1 / self.spec.period:.0f} Hz, {ranges}>"

    @property
    def valves(self) -> bool:
        """Whether its commands are those of on/off valves, for whole periods or in pulses too."""
        return self.commands != "continuous"

    @property
    def outputs(self) -> NDArray[np.int64]:
        """Places in an observation that the networks predict, in their order."""
        places = np.arange(self.window.observation_size)
        derived = (places < self.window.joint_size) & (places % len(QUANTITIES) == _VELOCITY)
        return places if self.velocity == "network" else places[~derived]

    @property
    def reads(self) -> NDArray[np.bool_]:
        """Which inputs some network reads, shape (input_size,): an agent may see more of the past than they do."""
        weights = [w for one in self.networks for w in (one.hidden_weights, one.direct) if w is not None]
        found: NDArray[np.bool_] = np.any(np.concatenate(weights, axis=1) != 0, axis=1)
        return found

    @property
    def measured(self) -> NDArray[np.bool_]:
        """Which outputs a sensor stands behind: no pressures that are estimated, or of a muscle that is not there."""
        places = self.outputs
        muscle = np.where(places < self.window.joint_size, places % len(QUANTITIES) - _VELOCITY, 0)
        return muscle <= (self.spec.muscles if self.spec.pressure_sensors else 0)

    @property
    def errors(self) -> NDArray[np.float64]:
        """``error_std`` and ``further_std`` in the order of an observation, shape (observation_size,)."""
        return np.concatenate([self.error_std.ravel(), self.further_std])

    def with_errors(self, errors: NDArray[np.float64]) -> Self:
        """Return it with other :attr:`errors`."""
        size = self.window.joint_size
        return replace(self, error_std=self.window.of_joints(errors), further_std=errors[size:])

    @property
    def limits(self) -> NDArray[np.float64]:
        """Lowest and highest value of each place in a prediction, shape (2, observation_size)."""
        limits = np.empty((self.window.joints, len(QUANTITIES), 2))
        limits[:, _ANGLE] = self.spec.angle_range
        limits[:, _VELOCITY] = -np.inf, np.inf
        limits[:, -2:] = self.pressure_range
        return np.concatenate([limits.reshape(-1, 2), self.further_range]).T

    def predict(self, inputs: ArrayLike) -> NDArray[np.float64]:
        """Return o_{k+1} (n, observation_size) for sigma_k and a_k (n, input_size), both in sensor units."""
        inputs = np.asarray(inputs, np.float64)
        scaled = self.scaling.inputs(inputs, self.window)
        change = np.concatenate([network(scaled) for network in self.networks], axis=1)
        now = inputs[:, : self.window.observation_size]
        following = now.copy()
        following[:, self.outputs] += change * self.scaling.observation_scale[self.outputs]
        np.clip(following, *self.limits, out=following)
        if self.velocity == "derived":
            angle, velocity = (slice(q, self.window.joint_size, len(QUANTITIES)) for q in (_ANGLE, _VELOCITY))
            following[:, velocity] = (following[:, angle] - now[:, angle]) / (1e3 * self.spec.period)
        return following

    def save(self, path: str | Path) -> None:
        """Write the simulation to ``path``, whole or not at all.

        Raises:
            UnusableInput: the parent folder is missing or cannot be written.

        """
        header, arrays = self.parts()
        write_arrays(Path(path), KIND, header, arrays)

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read a simulation that :meth:`save` wrote.

        Raises:
            UnusableInput: no such file, or not one whose arrays fit together.

        """
        path = Path(path)
        settings, arrays = read_arrays(path, KIND)
        try:
            return cls.of_parts(settings, arrays)
        except (msgspec.ValidationError, UnusableInput, ValueError, KeyError) as error:
            raise UnusableInput(f"{path}: is no usable simulation ({error}); fit it again") from error

    def parts(self) -> tuple[dict[str, Any], dict[str, NDArray[np.float64]]]:
        """Return what a file has to hold: settings for its header, and arrays."""
        direct = [network.direct is not None for network in self.networks]
        header = _Header(
            self.spec, self.window, self.velocity, self.commands, self.held_out, self.seed, direct, self.spread
        )
        names = (*_ARRAYS, *(_FURTHER if self.window.further else ()), *(_LIMITS if len(self.goal_ways) else ()))
        arrays: dict[str, NDArray[np.float64]] = {name: getattr(self, name) for name in names}
        arrays |= {name: getattr(self.scaling, name) for name in _SCALINGS}
        for number, network in enumerate(self.networks):
            layers = {name: getattr(network, name) for name in (*_LAYERS, "direct", *_SECOND)}
            arrays |= {f"network_{number}_{name}": array for name, array in layers.items() if array is not None}
        settings = {**asdict(header), "stretch": self.stretch, "grid": asdict(self.grid)}
        for name, usual in (("stretch", self.stretch == 0), ("grid", self.grid == GridSettings())):
            if usual:
                del settings[name]  # older versions read what has none
        return settings, arrays

    @classmethod
    def of_parts(cls, settings: Any, arrays: dict[str, NDArray[Any]]) -> Self:
        """Return what :meth:`parts` came from.

        Raises:
            ValueError, KeyError, msgspec.ValidationError, UnusableInput: they do not fit together.

        """
        header = msgspec.convert(settings, _Header)
        simulation = cls._assembled(header, {name: _floats(name, array) for name, array in arrays.items()})
        _check(simulation)
        return simulation

    @classmethod
    def _assembled(cls, header: "_Header", arrays: dict[str, NDArray[np.float64]]) -> Self:
        def network(number: int) -> Network:
            weights, bias, output_weights, output_bias = (arrays.pop(f"network_{number}_{name}") for name in _LAYERS)
            direct = arrays.pop(f"network_{number}_direct") if header.direct[number] else None
            second_weights, second_bias = (arrays.pop(f"network_{number}_{name}", None) for name in _SECOND)
            return Network(weights, bias, output_weights, output_bias, direct, second_weights, second_bias)

        networks = tuple(network(number) for number in range(len(header.direct)))
        scaling = Scaling(**{name: arrays.pop(name) for name in _SCALINGS})
        further = _FURTHER if header.window.further else ()
        limits = _LIMITS if _LIMITS[0] in arrays else ()
        rest = {name: arrays.pop(name) for name in (*_ARRAYS, *further, *limits)}
        if arrays:
            raise ValueError(f"it also holds {', '.join(sorted(arrays))}")
        return cls(
            spec=header.spec,
            window=header.window,
            scaling=scaling,
            networks=networks,
            velocity=header.velocity,
            commands=header.commands,
            spread=header.spread,
            held_out=header.held_out,
            stretch=header.stretch,
            seed=header.seed,
            grid=header.grid,
            **rest,
        )


_ARRAYS = ("error_std", "goal_range", "pressure_range")
_FURTHER = ("further_std", "further_range")
_LIMITS = ("goal_ways", "goal_limits")
_SCALINGS = ("observation_offset", "observation_scale", "command_scale")
_LAYERS = ("hidden_weights", "hidden_bias", "output_weights", "output_bias")
_SECOND = ("second_weights", "second_bias")


@dataclass(frozen=True)
class _Header:
    """What the file holds besides arrays."""

    spec: ArmSpec
    window: Window
    velocity: Velocity
    commands: Commands
    held_out: float
    seed: int
    direct: list[bool]
    """For each network whether it has direct connections."""
    spread: bool = False
    stretch: int = 0
    grid: GridSettings = field(default_factory=GridSettings)


def _floats(name: str, array: NDArray[np.generic]) -> NDArray[np.float64]:
    if array.dtype.kind != "f":
        raise ValueError(f"{name} holds {array.dtype}, not floating-point numbers")
    return array.astype(np.float64)


def _check(simulation: Simulation) -> None:
    """Raise ValueError unless sizes, shapes and ranges fit together."""
    window, scaling = simulation.window, simulation.scaling
    if window.joints != simulation.spec.joints or window.joints < 1 or window.history < 1:
        raise ValueError(f"its {window} does not fit to an arm with {simulation.spec.joints} joint(s)")
    if not (0 <= simulation.held_out < 1 and simulation.seed >= 0 and simulation.stretch >= 0):
        apart = simulation.held_out, simulation.stretch
        raise ValueError(f"its share and stretch held out are {apart}, its seed {simulation.seed}")
    window.require(simulation.spec.further, "its arm")
    if window.velocity == "measured" and simulation.velocity != "network":
        raise ValueError("a measured velocity needs a network of its own")
    joints, observed, further = window.joints, window.observation_size, len(window.further)
    _expect("observation_offset", scaling.observation_offset, (observed,))
    _expect("observation_scale", scaling.observation_scale, (observed,), scaling.observation_scale > 0)
    _expect("command_scale", scaling.command_scale, (2 * joints,), scaling.command_scale > 0)
    _expect("error_std", simulation.error_std, (joints, 4), simulation.error_std >= 0)
    _expect("further_std", simulation.further_std, (further,), simulation.further_std >= 0)
    ways = len(simulation.goal_limits)
    _expect("goal_ways", simulation.goal_ways, (ways, joints if ways else simulation.goal_ways.shape[1]))
    for name, array, shape in (
        ("goal_limits", simulation.goal_limits, (ways, 2)),
        ("goal_range", simulation.goal_range, (joints, 2)),
        ("pressure_range", simulation.pressure_range, (joints, 2, 2)),
        ("further_range", simulation.further_range, (further, 2)),
    ):
        _expect(name, array, shape)
        _expect(name, array, shape, array[..., 0] <= array[..., 1])
    outputs = len(simulation.outputs)
    if len(simulation.networks) not in (1, outputs):
        raise ValueError(f"expected 1 or {outputs} networks, got {len(simulation.networks)}")
    if len({network.second_bias is None for network in simulation.networks}) > 1:
        raise ValueError("either all of its networks have a second hidden layer or none has")
    each = outputs // len(simulation.networks)
    for network in simulation.networks:
        hidden = network.hidden_bias.size
        _expect("hidden_weights", network.hidden_weights, (window.input_size, hidden))
        _expect("hidden_bias", network.hidden_bias, (hidden,))
        if network.second_weights is not None and network.second_bias is not None:
            _expect("second_weights", network.second_weights, (hidden, network.second_bias.size))
            hidden = network.second_bias.size
        elif network.second_weights is not None or network.second_bias is not None:
            raise ValueError("a second hidden layer needs weights and a bias")
        _expect("output_weights", network.output_weights, (hidden, each))
        _expect("output_bias", network.output_bias, (each,))
        if network.direct is not None:
            _expect("direct", network.direct, (window.input_size, each))


def _expect(
    name: str, array: NDArray[np.float64], shape: tuple[int, ...], valid: NDArray[np.bool_] | None = None
) -> None:
    if array.shape != shape:
        raise ValueError(f"expected {name} of the shape {shape}, got {array.shape}")
    if valid is not None and not valid.all():
        raise ValueError(f"{name} holds values out of range")
