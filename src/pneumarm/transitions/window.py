"""The state window: the observations and actions of the last steps as one vector (thesis eq. 3.5).

With the history ``h`` (3 in the thesis) the state is, newest first,

    sigma_k = (o_k, o_{k-1}, ..., o_{k-h+1}, a_{k-1}, ..., a_{k-h+1})

where an observation ``o`` holds, joint after joint, angle [counts], velocity [counts/ms], pressure 1 and
pressure 2 [counts], then what further sensors said, and ``a`` the commands of the two muscles of every joint. The
input of the simulation is sigma_k followed by a_k; the input of an agent is sigma_k followed by the goal (thesis
eq. 4.12).
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm.seam import ArmSpec, SensorKind, velocity_name
from pneumarm.arm.velocity import derived_velocity
from pneumarm.errors import UnusableInput
from pneumarm.transitions.hysteresis import stops_of
from pneumarm.transitions.rows import Rows

QUANTITIES = ("angle", "velocity", "pressure_1", "pressure_2")
"""What an observation holds for each joint, in this order."""


@dataclass(frozen=True)
class Window:
    """Sizes and places in the state window."""

    joints: int = 1
    history: int = 3
    """Number of observations in the state (thesis eq. 3.5: three)."""
    velocity: Literal["derived", "measured"] = "derived"
    """Whether the velocity is derived from the angle (thesis section 2.3.4), or that of a sensor (section 7.3)."""
    further: tuple[str, ...] = ()
    """Names of further sensors whose readings an observation ends in, as in :attr:`~pneumarm.arm.ArmSpec.further`."""
    hysteresis: tuple[float, ...] = ()
    """Radii of the stop operators of each joint (:mod:`.hysteresis`) [counts]; the state ends in where these are."""

    @classmethod
    def of(
        cls, spec: ArmSpec, history: int, kinds: Iterable[SensorKind] = (), hysteresis: tuple[float, ...] = ()
    ) -> "Window":
        """Return the window of an arm ``spec`` with all its further sensors of these ``kinds``.

        Raises:
            UnusableInput: it has none of a kind.

        """
        wanted = set(kinds)
        offered = {one.kind for one in spec.sensors} | ({"velocity"} if spec.velocity_sensor else set())
        if missing := wanted - offered:
            raise UnusableInput(
                f"{spec.name} has no sensor of {' or '.join(sorted(missing))}; it has "
                f"{', '.join(sorted(offered)) or 'no further ones'}"
            )
        further = tuple(one.name for one in spec.sensors if one.kind in wanted)
        return cls(spec.joints, history, "measured" if "velocity" in wanted else "derived", further, hysteresis)

    @cached_property
    def needs(self) -> tuple[str, ...]:
        """Names of all that it takes besides angles and pressures: velocities if measured, then ``further``."""
        velocities = [velocity_name(j + 1) for j in range(self.joints)] if self.velocity == "measured" else []
        return (*velocities, *self.further)

    def require(self, offered: Iterable[str], whose: str) -> None:
        """Raise UnusableInput where ``whose`` sensors, called as ``offered``, are not all that it needs."""
        missing = [name for name in self.needs if name not in set(offered)]
        if missing:
            raise UnusableInput(
                f"{whose} lacks {', '.join(missing)}, which this simulation or agent was made with; use an arm that "
                "has these sensors, or fit and train without them"
            )

    def spec(self, spec: ArmSpec) -> ArmSpec:
        """Return ``spec`` with only those further sensors that the window needs."""
        sensors = tuple(one for one in spec.sensors if one.name in self.further)
        return replace(spec, velocity_sensor=self.velocity == "measured", sensors=sensors)

    @property
    def joint_size(self) -> int:
        """Numbers in one observation that belong to joints, those of :data:`QUANTITIES`; they come first."""
        return len(QUANTITIES) * self.joints

    @property
    def observation_size(self) -> int:
        """Numbers in one observation."""
        return self.joint_size + len(self.further)

    def of_joints(self, values: NDArray[Any]) -> NDArray[Any]:
        """Return the part of observations (..., observation_size) that is the joints', (..., joints, 4)."""
        return values[..., : self.joint_size].reshape(*values.shape[:-1], self.joints, len(QUANTITIES))

    @property
    def command_size(self) -> int:
        """Numbers in one command."""
        return 2 * self.joints

    @property
    def state_size(self) -> int:
        """Numbers in sigma."""
        return self.history * self.observation_size + (self.history - 1) * self.command_size + self.memory_size

    @property
    def memory_size(self) -> int:
        """Numbers at the end of sigma that tell of the movements before it."""
        return len(self.hysteresis) * self.joints

    @property
    def input_size(self) -> int:
        """Numbers in sigma and the action: the input of the simulation's networks."""
        return self.state_size + self.command_size

    @property
    def commanded(self) -> NDArray[np.int64]:
        """Places of the commands in an input, past ones and the newest."""
        past = np.arange(self.history * self.observation_size, self.state_size - self.memory_size)
        return np.concatenate([past, np.arange(self.state_size, self.input_size)])

    def remembered(self, inputs: NDArray[Any], observation: NDArray[Any]) -> NDArray[Any]:
        """Return where stop operators are (n, memory_size) once ``observation`` (n, observation_size) is made.

        ``inputs`` (n, at least state_size) are states before it, both in sensor units.
        """
        moved = (self.of_joints(observation) - self.of_joints(inputs[:, : self.observation_size]))[..., 0]
        before = inputs[:, self.state_size - self.memory_size : self.state_size]
        radii = np.tile(np.array(self.hysteresis, np.float64), self.joints)
        followed = before + np.repeat(moved, len(self.hysteresis), axis=1)
        return np.clip(followed, -radii, radii)

    def input_names(self) -> list[str]:
        """Return a name for each input, such as ``angle[k-1]``; with more joints ``angle of joint 2[k-1]``."""

        def named(quantities: tuple[str, ...], lag: int) -> list[str]:
            suffix = "[k]" if lag == 0 else f"[k-{lag}]"
            joints = range(self.joints)
            joint = [f" of joint {j + 1}" if self.joints > 1 else "" for j in joints]
            return [quantity + joint[j] + suffix for j in joints for quantity in quantities]

        commands = ("command_1", "command_2")

        def observed(lag: int) -> list[str]:
            suffix = "[k]" if lag == 0 else f"[k-{lag}]"
            return [*named(QUANTITIES, lag), *(name + suffix for name in self.further)]

        names = [name for lag in range(self.history) for name in observed(lag)]
        names += [name for lag in range(1, self.history) for name in named(commands, lag)]
        names += named(tuple(f"stop_{i + 1}" for i in range(len(self.hysteresis))), 0)
        return names + named(commands, 0)


class Transitions(NamedTuple):
    """``n`` transitions as input and target of a fit, in sensor units (not scaled)."""

    inputs: NDArray[np.float32]
    """sigma_k and a_k, shape (n, input_size)."""
    target: NDArray[np.float32]
    """o_{k+1}, shape (n, observation_size)."""
    sequence: NDArray[np.int64]
    """Shape (n,)."""
    step: NDArray[np.int64]
    """Step of k, shape (n,)."""
    interval: NDArray[np.float32]
    """t_{k+1} - t_k, shape (n,) [s]."""
    time: NDArray[np.float64]
    """t_k on the arm's clock, shape (n,) [s]."""

    @property
    def observation(self) -> NDArray[np.float32]:
        """o_k, shape (n, observation_size)."""
        return self.inputs[:, : self.target.shape[1]]


def observations(rows: Rows, window: Window) -> NDArray[np.float64]:
    """Return the observations of all rows, shape (n, observation_size).

    Where the velocity is not measured it is derived: omega_k = (theta_k - theta_{k-1}) / (t_k - t_{k-1}) (thesis
    section 2.3.4) [counts/ms]; 0 in the first row of a sequence or after a gap.

    Raises:
        UnusableInput: the rows lack readings of a sensor that the window needs.

    """
    window.require(rows.measured, "the recording")
    further = [rows.measured[name] for name in window.needs]
    if window.velocity == "measured":
        velocity = np.stack(further[: window.joints], axis=1)
        further = further[window.joints :]
    else:
        velocity = _derived_velocity(rows)
    stacked = np.stack([rows.angle, velocity, rows.pressure[:, :, 0], rows.pressure[:, :, 1]], axis=2)
    observed = stacked.reshape(len(rows), -1)
    return np.column_stack([observed, *further]) if further else observed


def _derived_velocity(rows: Rows) -> NDArray[np.float64]:
    velocity = np.zeros_like(rows.angle)
    follows = _follows(rows)
    with np.errstate(divide="ignore", invalid="ignore"):
        derived = derived_velocity(rows.angle[1:], rows.angle[:-1], np.diff(rows.time)[:, None])
    velocity[1:] = np.where(follows[1:, None], derived, 0.0)
    return velocity


def transitions(rows: Rows, window: Window) -> Transitions:
    """Return all transitions of ``rows`` whose window is complete.

    A window that reaches before the first row of a sequence is complete if the sequence began at rest: the arm
    stood there with closed valves. After a gap, or in a sequence that began in motion, ``history`` rows have to
    pass first (the oldest velocity needs one row more than the window).
    """
    observed = observations(rows, window)
    command = rows.command.reshape(len(rows), -1)
    follows = _follows(rows)
    index = np.arange(len(rows))
    first = np.maximum.accumulate(np.where(follows, 0, index))  # where the run of joined rows began
    position = index - first
    padded = rows.at_rest & (rows.step[first] == 0)
    has_next = np.append(follows[1:], False)
    usable = has_next & (padded | (position >= window.history)) & ~np.isnan(command).any(axis=1)
    k = np.flatnonzero(usable)
    parts = [observed[np.maximum(k - lag, first[k])] for lag in range(window.history)]
    for lag in range(1, window.history):
        inside = (position[k] >= lag)[:, None]
        parts.append(np.where(inside, command[np.maximum(k - lag, 0)], 0.0))
    parts += [memories(rows, window)[k], command[k]]
    return Transitions(
        inputs=np.concatenate(parts, axis=1, dtype=np.float32),
        target=observed[k + 1].astype(np.float32),
        sequence=rows.sequence[k],
        step=rows.step[k],
        interval=(rows.time[k + 1] - rows.time[k]).astype(np.float32),
        time=rows.time[k],
    )


def memories(rows: Rows, window: Window) -> NDArray[np.float64]:
    """Return where the stop operators of the joints are in all rows, shape (n, memory_size) [counts].

    They begin at 0 with every sequence, and after a gap.
    """
    first = np.maximum.accumulate(np.where(_follows(rows), 0, np.arange(len(rows))))
    return stops_of(rows.angle, first, np.array(window.hysteresis, np.float64))


def _follows(rows: Rows) -> NDArray[np.bool_]:
    """Return for each row whether it continues the row before it."""
    follows = np.zeros(len(rows), bool)
    follows[1:] = (np.diff(rows.sequence) == 0) & (np.diff(rows.step) == 1) & (np.diff(rows.time) > 0)
    return follows
