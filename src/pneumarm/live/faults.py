"""The faults of a virtual arm that a page switches on and off: large enough to be seen at once."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from pneumarm.arm.virtual import VirtualArm
from pneumarm.arm.virtual.faults import (
    Cold,
    DeadPotentiometer,
    Fault,
    FrozenPotentiometer,
    Leak,
    Payload,
    SensorNoise,
    StuckValve,
    SupplyLoss,
    SwappedValves,
    WornPotentiometer,
)
from pneumarm.errors import UnusableInput

Place = Literal["arm", "joint", "muscle"]


@dataclass(frozen=True)
class Offered:
    """A fault that can be switched on."""

    words: str
    """What it is, for people."""
    place: Place
    """What has to be said of where it is."""
    make: Callable[..., Fault]
    """Takes ``begin`` and what has to be said of its place."""


OFFERED: dict[str, Offered] = {
    "leak": Offered("leaking muscle", "muscle", lambda **at: Leak(factor=300.0, **at)),
    "inlet-closed": Offered("inlet stuck closed", "muscle", lambda **at: StuckValve(valve="inlet", **at)),
    "inlet-open": Offered(
        "inlet stuck open", "muscle", lambda **at: StuckValve(valve="inlet", position="open", **at)
    ),
    "outlet-closed": Offered("outlet stuck closed", "muscle", lambda **at: StuckValve(valve="outlet", **at)),
    "swapped-valves": Offered("valves swapped", "muscle", SwappedValves),
    "payload": Offered("0.2 kg more at the end", "joint", lambda **at: Payload(mass=0.2, **at)),
    "dead-potentiometer": Offered("potentiometer dead", "joint", DeadPotentiometer),
    "frozen-potentiometer": Offered("potentiometer slips", "joint", FrozenPotentiometer),
    "worn-potentiometer": Offered("potentiometer worn", "joint", WornPotentiometer),
    "sensor-noise": Offered("noisy sensors", "arm", SensorNoise),
    "supply-loss": Offered("supply falls to 0.5 bar", "arm", lambda **at: SupplyLoss(to=0.5, over=1.0, **at)),
    "cold": Offered("cold: 5 °C", "arm", Cold),
}
"""By the name that a page gives."""
_At = tuple[str, int, int]


class Switches:
    """The faults of ``arm`` that are switched on."""

    def __init__(self, arm: VirtualArm) -> None:
        self.arm = arm
        self._on: dict[_At, Fault] = {}
        self._others = arm.faults  # of a plan that it was opened with

    @property
    def on(self) -> list[_At]:
        """Name, joint and muscle, from 1, of what is switched on; 0 where that does not matter."""
        return list(self._on)

    def switch(self, name: str, joint: int, muscle: int, on: bool) -> None:
        """Switch a fault ``on`` or off, from now on.

        Raises:
            UnusableInput: there is no such fault, no such place, or another fault is in the same part.

        """
        offered = OFFERED.get(name)
        if offered is None:
            raise UnusableInput(f"no fault {name!r}; there are {', '.join(OFFERED)}")
        at: _At = name, 0 if offered.place == "arm" else joint, muscle if offered.place == "muscle" else 0
        wanted = {one: fault for one, fault in self._on.items() if one != at}
        if on:
            places = {"joint": at[1], "muscle": at[2]}
            wanted[at] = offered.make(begin=self.arm.time, **{key: value for key, value in places.items() if value})
        self.arm.faults = (*self._others, *wanted.values())
        self._on = wanted
