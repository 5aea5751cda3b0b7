"""The errors of thesis appendix A, each with the runs that show it."""

from collections.abc import Callable
from dataclasses import dataclass, replace

from matplotlib.figure import Figure

from pneumarm.appendix_a import pictures
from pneumarm.appendix_a.headless import HeadlessArm
from pneumarm.appendix_a.runs import Case, RunsSettings, run
from pneumarm.arm import Arm, ArmSpec
from pneumarm.arm.serial import BoardLine, EmulatedBoard, FaultyLine, LineFaults, SerialArm
from pneumarm.arm.virtual import (
    Fault,
    LogarithmicPotentiometer,
    SensorNoise,
    ValveSideSensor,
    VirtualArm,
    WornPotentiometer,
    draw_parameters,
)

CLAIMS = 0.05
"""Share of the readings for which the driver claims that the buffer is empty."""


@dataclass(frozen=True)
class Shown:
    """A picture of several cases side by side."""

    figure: Figure
    caption: str


@dataclass(frozen=True)
class Error:
    """One of the errors, what it did, and what reveals it."""

    title: str
    happened: str
    """What the thesis tells, and how it was played."""
    cases: tuple[Case, ...]
    """The arm without the error, then with it, then with a remedy where there is one."""
    shown: tuple[Shown, ...]


def lived(
    seed: int = 0,
    settings: RunsSettings = RunsSettings(),
    *,
    progress: Callable[[float, float], None] | None = None,
) -> list[Error]:
    """Return the errors as they show themselves on the virtual arm ``seed``; 0 is the nominal one."""
    told, made, total = progress or (lambda done, total: None), 0, 9
    told(made, total)

    def case(name: str, arm: Arm, before: Case | None = None, *, checked: bool = True) -> Case:
        nonlocal made
        simulation = None if before is None else before.simulation
        result = run(name, arm, settings, seed=seed, before=simulation, checked=checked)
        made += 1
        told(made, total)
        return result

    healthy = case("healthy", virtual(seed))
    leaps = (healthy, case("sensor at the valve", virtual(seed, ValveSideSensor(muscle=1)), healthy))
    bent = (healthy, case("logarithmic", virtual(seed, LogarithmicPotentiometer()), healthy))
    worn = (healthy, case("worn", virtual(seed, WornPotentiometer(angle=5.0, height=15.0, contact=8.0)), healthy))
    loud = SensorNoise(angle=6.0, pressure=6.0)
    noisy = (
        healthy,
        case("noise, single readings", virtual(seed, loud, conversions=1), healthy),
        case("noise, medians of 9", virtual(seed, loud, conversions=9), healthy),
    )
    sound = case("driver in order", SerialArm(*board(seed, 0.0)), checked=False)
    lost = (
        sound,
        case("claims believed", HeadlessArm(*board(seed, CLAIMS)), sound, checked=False),
        case("claims seen through", SerialArm(*board(seed, CLAIMS)), sound, checked=False),
    )
    return [
        Error(
            "Leaps in pressure",
            "The pressure sensors were at the valves' side of the muscles. While air flows they read what flows; "
            "only 10 ms after a valve has closed they read what is in the muscle. The isoplots of the pressures "
            "were very poor, those of the angle fine (A.1.1, figures A.1 and A.2). Played by the sensor of muscle "
            "1. Here valves stay as they are while a reading is made, and the leap is the same each time: a "
            "simulation learns it, and its isoplot is hardly worse. A close look at a pulse reveals it.",
            leaps,
            (
                Shown(pictures.opening(leaps), "Pressure 1 around a pulse of air (grey), read every millisecond."),
                Shown(pictures.isoplots(leaps, (2, 3)), "Isoplots of both pressures; only sensor 1 is misplaced."),
            ),
        ),
        Error(
            "A logarithmic potentiometer",
            "The first potentiometer was one for loudness (A.1.2). A simulation can be fitted to it as well: what "
            "is far from linear is how far the arm turns for a count, and that is seen with the arm at rest.",
            bent,
            (
                Shown(pictures.sweeps(bent), "Angle at rest against the difference of the pressures, up and down."),
                Shown(pictures.by_angle(bent), "Residue of the angle by angle, with mean and standard deviation."),
            ),
        ),
        Error(
            "A worn potentiometer",
            "The axis was pressed on all the time, and the isoplots of the angle became worse and worse (A.1.2). "
            "Played by a track that is worn around 5 degrees, where it reads wrong and differently each time.",
            worn,
            (
                Shown(pictures.by_angle(worn), "Residue of the angle by angle, with mean and standard deviation."),
                Shown(pictures.isoplots(worn, (0, 1)), "Isoplots of angle and velocity, which is derived from it."),
            ),
        ),
        Error(
            "Noise",
            "Noise as wide as the isoplots (A.1.3). With the muscles filled and closed, and what drifts taken "
            "out, its covariance is that of white noise: so conversions one after the other are independent, and "
            "the median of several of them is worth making. Played by 6 counts on every conversion.",
            noisy,
            (
                Shown(pictures.noise(noisy), "Pressure 1 at rest, detrended: power spectrum and autocovariance."),
                Shown(pictures.isoplots(noisy, (0, 2)), "Isoplots of angle and pressure 1."),
            ),
        ),
        Error(
            "A lost buffer",
            "The driver claimed that the buffer was empty while the answer was in it (A.1.4). A host without "
            "headers and time stamps goes on with what it read before, as if it were new. The protocol's sequence "
            f"numbers and time stamps see through the claims. Played on the emulated board, for {CLAIMS:.0%} of "
            "what is read.",
            lost,
            (
                Shown(pictures.in_a_row(lost), "Residue of the angle, transition after transition."),
                Shown(
                    pictures.isoplots(lost, (0, 1)),
                    "Isoplots of angle and velocity: a reading that was "
                    "taken again is no observed change, and two at once after it.",
                ),
            ),
        ),
    ]


def virtual(seed: int, *faults: Fault, conversions: int | None = None) -> VirtualArm:
    """Return the virtual arm ``seed``, 0 being the nominal one, with ``faults`` from the begin on."""
    arm = VirtualArm(seed=seed) if seed == 0 else VirtualArm(draw_parameters(seed), seed=seed)
    parameters = arm.parameters
    if conversions is not None:
        parameters = replace(parameters, sensors=replace(parameters.sensors, conversions=conversions))
    return VirtualArm(parameters, seed=seed, faults=faults)


def board(seed: int, claims: float) -> tuple[FaultyLine, ArmSpec]:
    """Return a line to an emulated board with the virtual arm behind it, in the arm's own time, and its spec."""
    arm = virtual(seed)
    line = FaultyLine(BoardLine(EmulatedBoard(arm)), LineFaults(claims_empty=claims, seed=seed))
    return line, arm.spec
