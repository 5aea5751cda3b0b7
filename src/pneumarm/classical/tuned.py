"""A tuned controller as a file: all that it needs to move the arm that it was tuned on, for people to read."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, Self

import msgspec
import numpy as np
from numpy.typing import NDArray

from pneumarm.arm import Arm, ArmSpec
from pneumarm.arm.seam import check_pressures
from pneumarm.classical.calibration import Calibration
from pneumarm.classical.cascade import Cascade, CascadeGains, Scheduled, ScheduledGains
from pneumarm.classical.following import ClassicalController, CommonGains, Law
from pneumarm.classical.pulse_width import PulseWidth, PulseWidthGains
from pneumarm.classical.sliding import Sliding, SlidingGains
from pneumarm.errors import UnusableInput
from pneumarm.files import read_beginning, read_json, write_json

_FORMAT = "pneumarm tuned controller 1"
_LARGEST = 1 << 20


class Kind(NamedTuple):
    """A kind of controller."""

    gains: type[CommonGains]
    law: Callable[..., Law]
    pulses: bool
    """Whether it can make use of pulses."""


KINDS = {
    "pid": Kind(CascadeGains, Cascade, True),
    "pwm": Kind(PulseWidthGains, PulseWidth, True),
    "sliding": Kind(SlidingGains, Sliding, False),
    "scheduled": Kind(ScheduledGains, Scheduled, True),
}
"""By the names that ``pneumarm tune`` knows."""


@dataclass(frozen=True)
class Tuned:
    """A tuned controller."""

    kind: str
    """One of :data:`KINDS`."""
    spec: ArmSpec
    """The arm, with the control period that it was tuned for."""
    calibration: Calibration
    gains: CommonGains
    shortest_pulse: float | None
    """Shortest pulse that it opens a valve for [s]; None where valves are set for whole periods."""
    seconds: float
    """Arm time that tuning took, calibration among it [s]."""
    cost: float
    """Cost of the gains, as measured in the end, see :mod:`pneumarm.classical.tuning`; -1 where there was no time."""

    @property
    def is_as_it_began(self) -> bool:
        """Whether its gains are those that tuning begins with: no better ones were found, or none were tried."""
        mine, first = vars(self.gains), vars(KINDS[self.kind].gains())
        return all(np.isclose(mine[name], first[name]) for name in first)

    @property
    def goal_range(self) -> NDArray[np.float64]:
        """Angles that the arm was seen to rest at, shape (joints, 2) [counts]."""
        return np.array(self.calibration.goal_range)

    def controller(self) -> ClassicalController:
        """Return it as a controller."""
        law = KINDS[self.kind].law
        pairs = zip(self.calibration.maps, self.calibration.rates, strict=True)
        laws = [law(self.spec, static_map, rates, self.gains, self.shortest_pulse) for static_map, rates in pairs]
        return ClassicalController(
            self.spec, self.gains, laws, self.goal_range, pulses=self.shortest_pulse is not None
        )

    def check_fit(self, arm: Arm) -> None:
        """Raise UnusableInput where it was tuned for an arm of another kind; of the period it is not asked."""
        for name in ("joints", "muscles", "counts_per_degree", "counts_per_bar", "angle_range"):
            tuned, found = getattr(self.spec, name), getattr(arm.spec, name)
            if not np.allclose(tuned, found, rtol=1e-3):
                raise UnusableInput(
                    f"this controller was tuned on an arm whose {name} is {tuned}, that of {arm.spec.name} is {found}"
                )

        check_pressures(self.spec, arm.spec, "this controller was tuned")

    def __repr__(self) -> str:
        cost = f"cost {self.cost:.3f}" if self.cost >= 0 else "too little time to compare gains"
        return f"<Tuned {self.kind} for {self.spec.name}, {1 / self.spec.period:.0f} Hz, {cost}>"

    def save(self, path: Path) -> None:
        """Write it to ``path``, whole or not at all."""
        write_json(path, {"format": _FORMAT, **msgspec.to_builtins(self)})

    @classmethod
    def of(cls, values: dict[str, Any]) -> Self:
        """Return what :meth:`save` wrote, as plain values; raises ``msgspec.ValidationError`` or ``KeyError``."""
        kind = msgspec.convert(values["kind"], str)
        return cls(
            kind=kind,
            spec=msgspec.convert(values["spec"], ArmSpec),
            calibration=msgspec.convert(values["calibration"], Calibration),
            gains=msgspec.convert(values["gains"], KINDS[kind].gains),
            shortest_pulse=msgspec.convert(values["shortest_pulse"], float | None),
            seconds=msgspec.convert(values["seconds"], float),
            cost=msgspec.convert(values["cost"], float),
        )


def is_tuned(path: Path) -> bool:
    """Return whether ``path`` looks like the file of a tuned controller: those of agents are not JSON."""
    try:
        return read_beginning(path, "a controller", 1) == b"{"
    except UnusableInput:
        return False


def load_tuned(path: Path) -> Tuned:
    """Return the tuned controller in ``path``.

    Raises:
        UnusableInput: it is none, or it is damaged.

    """
    expected = "a controller from `pneumarm tune`"
    values = read_json(path, expected, _LARGEST)
    if values.get("format") != _FORMAT:
        raise UnusableInput(f"{path}: expected {expected}, this is something else")
    try:
        return Tuned.of(values)
    except (msgspec.MsgspecError, KeyError, ValueError) as error:
        raise UnusableInput(f"{path}: expected {expected}, it is damaged ({error})") from error
