"""The errors of thesis appendix A, each with the runs that show it."""

import tomllib
from collections.abc import Callable
from dataclasses import dataclass, replace
from importlib import resources

import msgspec
from matplotlib.figure import Figure

from pneumarm.appendix_a import case_pictures
from pneumarm.appendix_a.headless import HeadlessArm
from pneumarm.appendix_a.runs import Case, RunsSettings, run
from pneumarm.arm import Arm, ArmSpec
from pneumarm.arm.serial import BoardLine, EmulatedBoard, FaultyLine, LineFaults, SerialArm
from pneumarm.arm.virtual import (
    Fault,
    LogarithmicPotentiometer,
    ReducerLeak,
    SensorNoise,
    ValveSideSensor,
    VirtualArm,
    WornPotentiometer,
    draw_parameters,
)

CLAIMS = 0.05
"""Share of the readings for which the driver claims that the buffer is empty."""


class PictureWords(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A picture of several cases side by side."""

    draw: str
    """Function of :mod:`.case_pictures`."""
    caption: str
    quantities: tuple[int, ...] = ()
    """That it shows, where it can show several."""


class ErrorWords(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """An error in words, as in ``errors.toml``."""

    title: str
    happened: str
    """What the thesis tells, and how it is played."""
    cases: str
    """Name of the runs that show it."""
    pictures: tuple[PictureWords, ...]


class _ErrorsFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    errors: tuple[ErrorWords, ...]


@dataclass(frozen=True)
class PlayedError:
    """One of the errors, what it did, and what reveals it."""

    words: ErrorWords
    cases: tuple[Case, ...]
    """The arm without the error, then with it, then with a remedy where there is one."""

    def drawn(self) -> list[tuple[Figure, str]]:
        """Return the pictures that reveal it, with their captions."""
        return [
            (getattr(case_pictures, one.draw)(self.cases, *([one.quantities] if one.quantities else [])), one.caption)
            for one in self.words.pictures
        ]


def play_errors(
    seed: int = 0,
    settings: RunsSettings = RunsSettings(),
    *,
    progress: Callable[[float, float], None] | None = None,
) -> list[PlayedError]:
    """Return the errors as they show themselves on the virtual arm ``seed``; 0 is the nominal one."""
    text = (resources.files(__package__) / "errors.toml").read_text(encoding="utf-8")
    cases = _cases(seed, settings, progress or (lambda done, total: None))
    words = msgspec.convert(tomllib.loads(text), _ErrorsFile).errors
    return [PlayedError(one, cases[one.cases]) for one in words]


def _cases(
    seed: int, settings: RunsSettings, progress: Callable[[float, float], None]
) -> dict[str, tuple[Case, ...]]:
    """Run the arm without the errors and with each."""
    made, total = 0, 10
    progress(made, total)

    def case(name: str, arm: Arm, before: Case | None = None, *, checked: bool = True) -> Case:
        nonlocal made
        simulation = None if before is None else before.simulation
        result = run(name, arm, settings, seed=seed, before=simulation, checked=checked)
        made += 1
        progress(made, total)
        return result

    healthy = case("healthy", virtual(seed))
    worn, loud = WornPotentiometer(angle=5.0, height=15.0, contact=8.0), SensorNoise(angle=6.0, pressure=6.0)
    found = {
        "valve side": (healthy, case("sensor at the valve", virtual(seed, ValveSideSensor(muscle=1)), healthy)),
        "reducer": (healthy, case("reducer leaks", virtual(seed, ReducerLeak(rate=0.02)), healthy)),
        "logarithmic": (healthy, case("logarithmic", virtual(seed, LogarithmicPotentiometer()), healthy)),
        "worn": (healthy, case("worn", virtual(seed, worn), healthy)),
        "noise": (
            healthy,
            case("noise, single readings", virtual(seed, loud, conversions=1), healthy),
            case("noise, medians of 9", virtual(seed, loud, conversions=9), healthy),
        ),
    }
    sound = case("driver in order", SerialArm(*board(seed, 0.0)), checked=False)
    found["lost buffer"] = (
        sound,
        case("claims believed", HeadlessArm(*board(seed, CLAIMS)), sound, checked=False),
        case("claims seen through", SerialArm(*board(seed, CLAIMS)), sound, checked=False),
    )
    return found


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
