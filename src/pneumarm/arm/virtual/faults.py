"""What can go wrong with an arm, as data: a plan of faults, each with its place, its begin and its end.

A plan is a tuple of faults, or a TOML file with a table for each:

    [[fault]]
    kind = "stuck-valve"
    joint = 1
    muscle = 2
    valve = "outlet"
    position = "closed"
    begin = 60.0

Joints and muscles are counted from 1, times are on the arm's clock [s], and a fault without an end lasts. Sources:
the errors of thesis appendix A, and what cheap valves, hoses and potentiometers do. Who plays a plan refuses what
it cannot play; the virtual arm has no link and refuses the faults of one by name.
"""

import math
from collections.abc import Collection, Iterable, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec
from msgspec import Meta

from pneumarm.errors import UnusableInput
from pneumarm.files import read_toml
from pneumarm.settings import NonNegativeFloat, Valid, validate

LINK_KINDS = (
    "unplugged",
    "dropped-frames",
    "doubled-frames",
    "late-frames",
    "corrupted-frames",
    "empty-buffer",
)
"""Kinds of faults that only an arm behind a link can play."""
LONGEST_PLAN = 1000
"""Most faults of a plan."""
_LARGEST_FILE = 1 << 20

Part = tuple[str, ...]
"""A part of an arm that one fault at a time can be in."""


class Fault(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, tag_field="kind"):
    """What all faults have."""

    begin: NonNegativeFloat = 0.0
    """When it begins, on the arm's clock [s]."""
    end: float | None = None
    """When it is over [s]; never, where it is None."""

    def __post_init__(self) -> None:
        validate(self)

    def _valid(self) -> Valid:
        return {"end": self.end is None or self.begin < self.end or "later than its begin"}

    @property
    def kind(self) -> str:
        """Its name in a plan's file."""
        return str(type(self).__struct_config__.tag)

    @property
    def parts(self) -> frozenset[Part]:
        """The parts of the arm that it is in; no other fault can be in them at the same time."""
        return frozenset([(self.kind,)])

    def is_on(self, time: float) -> bool:
        """Whether it is on at ``time`` [s]."""
        return self.begin <= time and (self.end is None or time < self.end)

    def overlaps(self, other: "Fault") -> bool:
        """Whether both are on at some time."""
        return _end(self) > other.begin and _end(other) > self.begin


class _JointFault(Fault, frozen=True, kw_only=True):
    joint: int = 1
    """Joint, from 1."""

    @property
    def place(self) -> int:
        """Index of the joint."""
        return self.joint - 1


class _MuscleFault(_JointFault, frozen=True, kw_only=True):
    muscle: int = 1
    """Muscle of the joint, 1 or 2."""

    @property
    def index(self) -> tuple[int, int]:
        """Index of the muscle."""
        return self.joint - 1, self.muscle - 1


class StuckValve(_MuscleFault, frozen=True, kw_only=True, tag="stuck-valve"):
    """A valve that stays open or closed whatever it is told; the other valve of the muscle works."""

    valve: Literal["inlet", "outlet"] = "inlet"
    position: Literal["open", "closed"] = "closed"

    @property
    def parts(self) -> frozenset[Part]:
        """The valve."""
        return frozenset([_valve(*self.index, self.valve)])


class SwappedValves(_MuscleFault, frozen=True, kw_only=True, tag="swapped-valves"):
    """Inlet and outlet of a muscle wired in each other's place."""

    @property
    def parts(self) -> frozenset[Part]:
        """Both valves of the muscle."""
        return frozenset(_valve(*self.index, side) for side in ("inlet", "outlet"))


class SwappedMuscles(_MuscleFault, frozen=True, kw_only=True, tag="swapped-muscles"):
    """The valves of two muscles wired in each other's place: by default those of the two muscles of a joint."""

    other_joint: int | None = None
    """Joint of the other muscle; the same joint by default."""
    other_muscle: int | None = None
    """The other muscle; by default the antagonist."""

    @property
    def other(self) -> tuple[int, int]:
        """Index of the other muscle."""
        joint = self.joint if self.other_joint is None else self.other_joint
        muscle = 3 - self.muscle if self.other_muscle is None else self.other_muscle
        return joint - 1, muscle - 1

    @property
    def parts(self) -> frozenset[Part]:
        """All valves of both muscles."""
        return frozenset(_valve(*muscle, side) for muscle in (self.index, self.other) for side in ("inlet", "outlet"))


class Leak(_MuscleFault, frozen=True, kw_only=True, tag="leak"):
    """A muscle or its hose that leaks more than it did."""

    factor: Annotated[float, Meta(gt=0, lt=1_000_000)] = 3.0
    """How many times as much."""

    @property
    def parts(self) -> frozenset[Part]:
        """The hose."""
        return frozenset([("hose", str(self.joint), str(self.muscle))])


class SupplyLoss(Fault, frozen=True, kw_only=True, tag="supply-loss"):
    """The supply falls: a compressor that is off, a pinched hose (thesis A.1.1: other consumers in the building)."""

    to: Annotated[float, Meta(ge=0, le=10)] = 0.0
    """Pressure that it falls to [bar gauge]."""
    over: Annotated[float, Meta(ge=0, le=3600)] = 0.2
    """Time in which it falls, evenly [s]."""

    @property
    def parts(self) -> frozenset[Part]:
        """The supply."""
        return frozenset([("supply",)])


class ReducerLeak(Fault, frozen=True, kw_only=True, tag="reducer-leak"):
    """A reducer that leaks: while little air is consumed the buffer behind it fills up (thesis A.1.1: to 6 bar)."""

    rate: Annotated[float, Meta(gt=0, le=10)] = 0.005
    """Rise of the buffer's pressure while nothing is consumed [bar/s]."""
    source: Annotated[float, Meta(gt=0, le=10)] = 6.0
    """Pressure before the reducer, which the buffer's approaches [bar gauge]."""
    consumption: Annotated[float, Meta(ge=0, le=10)] = 0.01
    """Fall of the pressure by each inlet that is open [bar/s]; some 10 litres of buffer (thesis A.1.1)."""
    safety_valve: Annotated[float, Meta(gt=0, le=10)] | None = None
    """Pressure at which a safety valve on the buffer opens [bar gauge]; there is none by default, as before the
    thesis' engineers found out."""

    @property
    def parts(self) -> frozenset[Part]:
        """The supply."""
        return frozenset([("supply",)])


class _Potentiometer(_JointFault, frozen=True, kw_only=True):
    @property
    def parts(self) -> frozenset[Part]:
        """The potentiometer."""
        return frozenset([("potentiometer", str(self.joint))])


class DeadPotentiometer(_Potentiometer, frozen=True, kw_only=True, tag="dead-potentiometer"):
    """A broken wire: the reading lies on a rail of the converter."""

    rail: Literal["low", "high"] = "low"


class FrozenPotentiometer(_Potentiometer, frozen=True, kw_only=True, tag="frozen-potentiometer"):
    """An axis that slips: the reading stays what it was when the fault began."""


class LogarithmicPotentiometer(_Potentiometer, frozen=True, kw_only=True, tag="logarithmic-potentiometer"):
    """A potentiometer for loudness in place of a linear one (thesis A.1.2)."""

    middle: Annotated[float, Meta(ge=0.01, lt=0.5)] = 0.15
    """Reading in the middle of the track as a share of the highest one; 0.5 would be linear."""


class WornPotentiometer(_Potentiometer, frozen=True, kw_only=True, tag="worn-potentiometer"):
    """A track that is worn around an angle: it reads wrong there, and differently each time (thesis A.1.2)."""

    angle: Annotated[float, Meta(ge=-90, le=90)] = 0.0
    """Middle of the worn zone [degrees]."""
    width: Annotated[float, Meta(gt=0, le=90)] = 5.0
    """Standard deviation of the zone [degrees]."""
    height: Annotated[float, Meta(ge=0, le=1000)] = 10.0
    """Largest lasting error in the zone [counts]."""
    contact: Annotated[float, Meta(ge=0, le=1000)] = 5.0
    """Standard deviation of what changes from reading to reading in its middle [counts]."""


class SensorNoise(Fault, frozen=True, kw_only=True, tag="sensor-noise"):
    """More noise on every conversion (thesis A.1.3)."""

    angle: Annotated[float, Meta(ge=0, le=1000)] = 5.0
    """Standard deviation of a conversion of an angle [counts]."""
    pressure: Annotated[float, Meta(ge=0, le=1000)] = 5.0
    """Standard deviation of a conversion of a pressure [counts]."""


class ValveSideSensor(_MuscleFault, frozen=True, kw_only=True, tag="valve-side-sensor"):
    """A pressure sensor between valve and muscle: while air flows it reads what flows, not what is in the muscle.

    Thesis A.1.1 and figure A.1: leaps in pressure that are gone 10 ms after a valve closed.
    """

    share: Annotated[float, Meta(gt=0, le=1)] = 0.3
    """Part of the pressure drop between supply and muscle, or muscle and surroundings, that the sensor sees."""
    settling: Annotated[float, Meta(gt=0, le=1)] = 0.010
    """Time in which 95 % of a leap are gone after the valve has closed [s] (thesis: 10 ms)."""

    @property
    def parts(self) -> frozenset[Part]:
        """The sensor."""
        return frozenset([("pressure sensor", str(self.joint), str(self.muscle))])


class Cold(Fault, frozen=True, kw_only=True, tag="cold"):
    """Muscles and room are cold from the begin on; work and time warm the muscles again."""

    temperature: Annotated[float, Meta(gt=0, le=50)] = 5.0
    """Of muscles and room [degrees Celsius]."""


class Payload(_JointFault, frozen=True, kw_only=True, tag="payload"):
    """A mass added where the arm's weight is."""

    mass: Annotated[float, Meta(gt=0, le=100)] = 0.1
    """Added mass [kg]."""

    @property
    def parts(self) -> frozenset[Part]:
        """The weight."""
        return frozenset([("weight", str(self.joint))])


class Push(_JointFault, frozen=True, kw_only=True, tag="push"):
    """Something that pushes a joint: a hand, an obstacle that gives way."""

    torque: Annotated[float, Meta(ge=-1000, le=1000)] = 0.3
    """[N m], positive in the direction of growing angles."""

    @property
    def parts(self) -> frozenset[Part]:
        """What is pushed."""
        return frozenset([("push", str(self.joint))])


VIRTUAL_FAULTS = (
    StuckValve,
    SwappedValves,
    SwappedMuscles,
    Leak,
    SupplyLoss,
    ReducerLeak,
    DeadPotentiometer,
    FrozenPotentiometer,
    LogarithmicPotentiometer,
    WornPotentiometer,
    SensorNoise,
    ValveSideSensor,
    Cold,
    Payload,
    Push,
)
"""What a virtual arm can play."""
_BY_KIND: dict[str, type[Fault]] = {str(one.__struct_config__.tag): one for one in VIRTUAL_FAULTS}

Plan = tuple[Fault, ...]
"""Faults, in any order."""


def read_plan(path: Path | str) -> Plan:
    """Return the plan in the TOML file ``path``.

    Raises:
        UnusableInput: it cannot be read, or holds something else; the message says which table.

    """
    table = read_toml(path, "a TOML file with a plan of faults")
    tables = table.pop("fault", None)
    if table or not isinstance(tables, list):
        raise UnusableInput(f"{path}: expected tables [[fault]] and nothing else, got {', '.join(table) or 'none'}")
    return plan_of(tables, str(path))


def plan_of(tables: Iterable[Any], where: str = "plan") -> Plan:
    """Return the plan of ``tables``, a mapping with a ``kind`` each.

    Raises:
        UnusableInput: a table is not a fault that a virtual arm can play.

    """
    return tuple(_fault(table, f"{where}: fault {number}") for number, table in enumerate(tables, 1))


def _fault(table: Any, where: str) -> Fault:
    kind = table.get("kind") if isinstance(table, dict) else None
    if kind in LINK_KINDS:
        raise UnusableInput(f"{where}: {kind} is a fault of a serial link, which this arm does not have; remove it")
    if not isinstance(kind, str) or kind not in _BY_KIND:
        raise UnusableInput(f"{where}: expected a kind of {', '.join(_BY_KIND)}; got {kind!r}")
    try:
        return msgspec.convert(table, _BY_KIND[kind], strict=True)
    except (msgspec.ValidationError, UnusableInput) as error:
        raise UnusableInput(f"{where} ({kind}): {error}") from error


def check_plan(
    plan: Sequence[Fault], joints: int, playable: Collection[type[Fault]] = VIRTUAL_FAULTS, muscles: int = 2
) -> Plan:
    """Return ``plan`` as a tuple if an arm of ``joints`` joints, with so many ``muscles`` each, can play it.

    Raises:
        UnusableInput: a fault is not ``playable``, its place does not exist, or two are in the same part at once.

    """
    if len(plan) > LONGEST_PLAN:
        raise UnusableInput(f"a plan has at most {LONGEST_PLAN} faults, got {len(plan)}")
    for number, fault in enumerate(plan, 1):
        if type(fault) not in playable:
            raise UnusableInput(f"fault {number}: this arm cannot play {fault!r}; remove it")
        _check_place(fault, number, joints, muscles)
        for before, other in enumerate(plan[: number - 1], 1):
            shared = fault.parts & other.parts
            if shared and fault.overlaps(other):
                raise UnusableInput(
                    f"faults {before} ({other.kind}) and {number} ({fault.kind}) are in the same part at once "
                    f"({' '.join(min(shared))}); let one end before the other begins"
                )
    return tuple(plan)


def _check_place(fault: Fault, number: int, joints: int, muscles: int) -> None:
    places: list[tuple[int, int]] = []
    if isinstance(fault, _MuscleFault):
        places.append(fault.index)
    elif isinstance(fault, _JointFault):
        places.append((fault.place, 0))
    if isinstance(fault, SwappedMuscles):
        places.append(fault.other)
    for joint, muscle in places:
        if not (0 <= joint < joints and 0 <= muscle < muscles):
            there = "muscles 1 and 2" if muscles == 2 else "muscle 1"
            raise UnusableInput(
                f"fault {number} ({fault.kind}): this arm has joints 1 to {joints} with {there}, "
                f"got joint {joint + 1}, muscle {muscle + 1}"
            )
    if isinstance(fault, SwappedMuscles) and fault.index == fault.other:
        raise UnusableInput(f"fault {number} ({fault.kind}): a muscle cannot be swapped with itself")


def _valve(joint: int, muscle: int, side: str) -> Part:
    return "valve", str(joint + 1), str(muscle + 1), side


def _end(fault: Fault) -> float:
    return math.inf if fault.end is None else fault.end
