"""What a virtual arm is made of, in SI units, with the nominal values as defaults.

The defaults are the nominal arm (preset B of :func:`preset_parameters`). Where a figure comes from is said in
its docstring: the thesis, the literature, or an assumption. Pressures are gauge pressures unless called
absolute; "free air" is a volume of air at 100 kPa and 20 degrees Celsius (ISO 8778).
"""

import math
from dataclasses import dataclass, field, replace
from typing import Annotated

from msgspec import Meta

from pneumarm.errors import UnusableInput
from pneumarm.settings import NonNegativeFloat, NonNegativeInt, PositiveFloat, Settings, Share, Valid

BAR = 1e5
"""One bar [Pa]."""
ATMOSPHERE = 1.013 * BAR
"""Absolute pressure of the surroundings [Pa]."""
FREE_AIR = 1.0 * BAR
"""Absolute pressure at which flows are counted as volumes [Pa]."""
REFERENCE_TEMPERATURE = 20.0
"""Temperature at which a muscle's parameters hold [degrees Celsius]."""
PERIOD = 1 / 30
"""Control period [s] (thesis section 5.1: 30 Hz)."""
MOST_JOINTS = 4
"""Joints that an arm has at most."""
ELEMENTS = 4
"""Maxwell-slip elements and creep branches of a muscle."""
_ELEMENTS = Meta(min_length=ELEMENTS, max_length=ELEMENTS)


@dataclass(frozen=True)
class MuscleParameters(Settings):
    """One braided muscle of 30 mm (thesis section 2.2) with its valves and its hose."""

    diameter: PositiveFloat = 0.030
    """Diameter D0 at rest [m] (thesis section 2.2.3)."""
    weave_angle: Annotated[float, Meta(gt=0, lt=math.pi / 2)] = math.radians(45)
    """Angle theta0 of the strands with the axis at rest [rad] (thesis section 2.2.3)."""
    rest_length: PositiveFloat = 0.180
    """Length l0 of the braid at rest, without end fittings [m] (thesis section 2.2.3)."""
    tip: PositiveFloat = 1.0
    """Correction k of the contraction for the conical ends, where contracted (Tondu and Lopez)."""
    length_at_zero: PositiveFloat = 0.194
    """Length of the braid with the joint at 0 rad [m] (assumption: both ends of the stroke keep force)."""
    stop_length: PositiveFloat = 0.246
    """Length where the strands jam [m] (computed from the weave: 254.6 mm is the geometric limit)."""
    stop_stiffness: NonNegativeFloat = 2.5e4
    """Stiffness of the jammed braid [N/m] (assumption)."""
    bladder_stiffness: NonNegativeFloat = 100.0
    """Stiffness kb of the bladder [N/m] (order of magnitude from latex tubes)."""
    bladder_length: PositiveFloat = 0.180
    """Length over which the bladder pulls [m]."""
    threshold: PositiveFloat = 0.050 * BAR
    """Pressure at which the bladder touches the weave, at the rest length [Pa] (thesis 2.2.3; 0.036 to 0.072
    bar measured in Jiang et al., Actuators 15(1):21, 2026)."""
    bladder_diameter: PositiveFloat = 0.022
    """Diameter of the weave at which the bladder touches it without pressure [m]."""
    viscosity: NonNegativeFloat = 8.0
    """Viscous resistance without pressure [N s/m]."""
    viscosity_per_pressure: NonNegativeFloat = 8.0 / BAR
    """Viscous resistance by pressure [N s/m/Pa]."""
    friction: NonNegativeFloat = 0.40
    """Dry friction between the strands without pressure [N]."""
    friction_per_pressure: NonNegativeFloat = 5.5 / BAR
    """Dry friction by pressure [N/Pa]."""
    slip_lengths: Annotated[tuple[PositiveFloat, ...], _ELEMENTS] = (0.3e-3, 0.8e-3, 2.0e-3, 4.0e-3)
    """Stretch after which each Maxwell-slip element slips [m]."""
    slip_weights: Annotated[tuple[PositiveFloat, ...], _ELEMENTS] = (0.3, 0.3, 0.25, 0.15)
    """Share of each Maxwell-slip element in the dry friction."""
    creep_times: Annotated[tuple[PositiveFloat, ...], _ELEMENTS] = (1.5, 60.0, 1800.0, 22000.0)
    """Relaxation times of the rubber, a Prony series [s]."""
    creep_stiffness: Annotated[tuple[NonNegativeFloat, ...], _ELEMENTS] = (30.0, 30.0, 30.0, 35.0)
    """Stiffness of each branch of the Prony series [N/m]."""
    dead_volume: NonNegativeFloat = 15e-6
    """Volume of hose and fittings less that of the rubber [m3]."""
    inlet: PositiveFloat = 8.8e-10
    """Sonic conductance of everything between supply and muscle [m3/(s Pa)] (ISO 6358)."""
    outlet: PositiveFloat = 2.5e-9
    """Sonic conductance of valve and hose on the way out [m3/(s Pa)] (ISO 6358)."""
    critical_ratio: PositiveFloat = 0.3
    """Pressure ratio b below which the flow is choked (ISO 6358)."""
    laminar_ratio: Annotated[float, Meta(gt=0, lt=1)] = 0.999
    """Pressure ratio above which the flow is taken as laminar, so that its slope stays finite."""
    leak: NonNegativeFloat = 3e-8 / BAR
    """Leak to the surroundings, free air [m3/s/Pa] (assumption: 1.5 % of the pressure a minute)."""
    seat_leak: NonNegativeFloat = 0.1e-8 / BAR
    """Leak of the inlet valve's seat, free air [m3/s/Pa] (assumption)."""
    heat_capacity: PositiveFloat = 144.0
    """Heat capacity of 80 g of rubber and nylon [J/K]."""
    heat_transfer: PositiveFloat = 0.2
    """Heat given to the room [W/K] (estimate: a time constant of 9 to 18 minutes)."""
    sensor_share: Share = 0.0
    """Where its pressure sensor is: the part of the pressure drop between supply and muscle, or muscle and
    surroundings, that it sees while air flows; 0 at the muscle, more towards the valve (thesis A.1.1)."""
    sensor_settling: PositiveFloat = 0.010
    """Time in which 95 % of that are gone after the valve has closed [s] (thesis A.1.1: 10 ms)."""

    def _valid(self) -> Valid:
        return {
            "critical_ratio": self.critical_ratio < self.laminar_ratio or "below laminar_ratio",
            "bladder_diameter": self.bladder_diameter < self.diameter or "below diameter",
        }


@dataclass(frozen=True)
class JointParameters(Settings):
    """A hinge with a pulley, a hanging link with a weight on it, and two antagonistic muscles."""

    muscles: tuple[MuscleParameters, MuscleParameters] = (MuscleParameters(), MuscleParameters())
    """Muscle 1 turns the joint to positive angles, muscle 2 to negative ones."""
    radius: PositiveFloat = 0.034
    """Radius of the pulley [m] (computed from a sweep of 90 degrees)."""
    passing: tuple[float, ...] = ()
    """Radii [m] at which the cables of its muscles pass the joints further in, the first at the base; none where the
    muscles sit on the link before this one, and pull on nothing else."""
    mass: NonNegativeFloat = 0.37
    """Mass of the weight, of a link within an arm all of its mass [kg]."""
    distance: PositiveFloat = 0.21
    """Distance of the weight from the hinge [m]."""
    length: PositiveFloat = 0.21
    """Distance of the next hinge from this one, where there is one [m]."""
    link_inertia: NonNegativeFloat = 0.004
    """Moment of inertia of the rest of the link [kg m2]."""
    tilt: float = 0.0
    """Angle of the joint at which the weight would hang freely is ``-tilt`` [rad], the joints further in at 0."""
    stop_angle: Annotated[float, Meta(gt=0)] = math.radians(47)
    """Angle of the end stops either side [rad] (assumption)."""
    stop_stiffness: NonNegativeFloat = 60.0
    """Stiffness of the end stops [N m/rad] (assumption)."""
    stop_damping: NonNegativeFloat = 0.6
    """Damping of the end stops [N m s/rad] (assumption)."""
    viscosity: NonNegativeFloat = 0.002
    """Viscous friction of the bearings [N m s/rad] (thesis section 2.3.2: negligible)."""

    def _valid(self) -> Valid:
        return {"mass": self.inertia > 0 or "above 0 where link_inertia is 0"}

    @property
    def inertia(self) -> float:
        """Moment of inertia about the hinge [kg m2]."""
        return self.mass * self.distance**2 + self.link_inertia


@dataclass(frozen=True)
class AirParameters(Settings):
    """The supply, the pipes and the switching of the valves."""

    supply: PositiveFloat = 1.02 * BAR
    """Mean pressure of the supply [Pa] (2 bar absolute: the muscles saturate at 1 bar by themselves)."""
    fluctuation: NonNegativeFloat = 0.02 * BAR
    """Standard deviation of the supply's fluctuation [Pa] (thesis A.1.1: other consumers; size assumed)."""
    fluctuation_time: PositiveFloat = 5.0
    """Correlation time of the fluctuation [s] (assumption)."""
    compressor: NonNegativeFloat = 0.01 * BAR
    """Amplitude of the compressor's saw-tooth behind the reducer [Pa] (assumption)."""
    compressor_period: PositiveFloat = 120.0
    """Period of the saw-tooth [s] (assumption)."""
    safety_valve: PositiveFloat = 2.0 * BAR
    """The supply never exceeds this [Pa] (thesis A.1.1)."""
    polytropic: PositiveFloat = 1.2
    """Polytropic exponent n of the air in the muscles, between isothermal 1 and adiabatic 1.4."""
    pipe_delay: NonNegativeFloat = 0.010
    """Time in which a pressure wave passes the hose [s] (thesis section 5.1: about 10 ms)."""
    opening_time: NonNegativeFloat = 0.002
    """Time in which a valve opens [s]."""
    closing_time: NonNegativeFloat = 0.002
    """Time in which a valve closes [s]."""
    droop: NonNegativeFloat = 0.0
    """Fall of the supply by the free air that all inlets take [Pa s/m3]; 0 for a reducer that knows no load."""
    droop_time: PositiveFloat = 0.1
    """Time constant with which it falls and recovers [s]."""


@dataclass(frozen=True)
class RoomParameters(Settings):
    """The temperature around the arm: heated in the day, cold after the night."""

    cold: NonNegativeFloat = 17.0
    """What the room cools down to at night; the arm's clock starts in the morning [degrees Celsius]."""
    warm: NonNegativeFloat = 21.0
    """What the room warms up to in the day [degrees Celsius]."""
    time: PositiveFloat = 5400.0
    """Time constant of the room [s]."""
    day: NonNegativeFloat = 36000.0
    """Seconds of each 24 hours, from the start of the arm's clock, in which the room is heated [s]."""


@dataclass(frozen=True)
class SensorParameters(Settings):
    """A potentiometer at the hinge, a pressure sensor at each muscle, and the converter."""

    counts_per_degree: PositiveFloat = 11.378
    """Counts of the angle sensor per degree (thesis section 2.3.4: 1024/90)."""
    counts_per_bar: PositiveFloat = 166.0
    """Counts of the pressure sensors per bar (thesis section 2.3.4)."""
    bits: Annotated[int, Meta(ge=1, le=24)] = 10
    """Bits of the converter (thesis section 2.3.3: 10)."""
    angle_noise: NonNegativeFloat = 1.6
    """Standard deviation of one conversion of the angle [counts] (thesis A.1.3: at most 4 counts)."""
    pressure_noise: NonNegativeFloat = 1.6
    """Standard deviation of one conversion of a pressure [counts]."""
    noise_limit: NonNegativeFloat = 4.0
    """The noise never exceeds this [counts] (thesis A.1.3)."""
    conversions: int = 5
    """Conversions of which the median is read: 1, 5, 7 or 9 (thesis A.1.3; its default is not said)."""
    wear: NonNegativeFloat = 0.0
    """Height of the highest bump that wear has made in the potentiometer's track [counts] (thesis A.1.2)."""
    dropout: Share = 0.0
    """Chance that the worn potentiometer loses contact during a reading, which then is 0."""
    wear_seed: NonNegativeInt = 0
    """Where the bumps are."""

    def _valid(self) -> Valid:
        return {"conversions": self.conversions in (1, 5, 7, 9) or "1, 5, 7 or 9"}

    @property
    def highest(self) -> float:
        """Highest count of the converter."""
        return float(2**self.bits - 1)


@dataclass(frozen=True)
class ArmParameters(Settings):
    """A whole virtual arm; the defaults are the nominal one."""

    joints: Annotated[tuple[JointParameters, ...], Meta(min_length=1, max_length=MOST_JOINTS)] = (JointParameters(),)
    """From the base outwards: each hangs on the link of the one before."""
    coupling: Share = 1.0
    """How strongly the joints of a chain act on each other, by inertia, gravity and cables: 1 as in nature, 0 each as
    if alone (:mod:`pneumarm.arm.virtual.chain`). All have one supply and one board in any case."""
    air: AirParameters = field(default_factory=AirParameters)
    room: RoomParameters = field(default_factory=RoomParameters)
    sensors: SensorParameters = field(default_factory=SensorParameters)
    jitter: NonNegativeFloat = 1.5e-3
    """Standard deviation of the control interval [s] (thesis section 5.1: the operating system)."""
    max_pressure: PositiveFloat = 1.05 * BAR
    """The limit of ``ArmSpec.max_pressure`` [Pa]; presets A and C need it, B saturates below by itself."""
    period: PositiveFloat = PERIOD
    """Control period that it is made for [s]."""

    @property
    def links(self) -> tuple[float, ...]:
        """Lengths of the links, from hinge to hinge and from the last hinge to its weight, the hand [m]."""
        *inner, last = self.joints
        return (*(joint.length for joint in inner), last.distance)

    def _valid(self) -> Valid:
        passed = all(len(joint.passing) in (0, j) for j, joint in enumerate(self.joints))
        return {"joints": passed or "a radius for each joint that cables pass"}


def without_noise(parameters: ArmParameters) -> ArmParameters:
    """Return the same arm with sensors that only quantise and a control cycle that is never late."""
    sensors = replace(parameters.sensors, angle_noise=0.0, pressure_noise=0.0, dropout=0.0)
    return replace(parameters, sensors=sensors, jitter=0.0)


def preset_parameters(preset: str = "B") -> ArmParameters:
    """Return the arm of one of three readings of the thesis' "2 bar" and "0 to 1200 ms".

    ``A``: supply of 2 bar gauge through a narrow restriction; the pressure rises almost linearly. ``B`` (nominal):
    2 bar absolute; the muscles saturate at 1 bar. ``C``: 2 bar gauge and a cut-off at the pressure limit.

    Raises:
        UnusableInput: there is no such preset.

    """
    inlets = {"A": (2.0 * BAR, 3.1e-10), "B": (1.02 * BAR, 8.8e-10), "C": (2.0 * BAR, 6.0e-10)}
    if preset not in inlets:
        raise UnusableInput(f"preset {preset!r}: expected one of {', '.join(inlets)}")
    supply, inlet = inlets[preset]
    muscle = MuscleParameters(inlet=inlet)
    return ArmParameters(joints=(JointParameters((muscle, muscle)),), air=replace(AirParameters(), supply=supply))
