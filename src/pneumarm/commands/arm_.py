"""``pneumarm arm check``, ``calibrate``, ``sensors``, ``valves``, ``errors``, ``emulate`` and ``flash``."""

import sys
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Any, NamedTuple

import numpy as np

from pneumarm.appendix_a.runs import RunsSettings
from pneumarm.arm import Arm, ArmSpec, GuardedArm, Reading, guarded, open_arm
from pneumarm.arm.corrected import CorrectedArm
from pneumarm.arm.seam import measured, unit_of
from pneumarm.arm.serial import SerialArm
from pneumarm.arm.serial.protocol import EXTRAS, JOINTS, MUSCLES
from pneumarm.arm.spec_file import save_arm_file
from pneumarm.arm.wrapper import unwrapped
from pneumarm.checkup import (
    ArmCalibration,
    Checkup,
    CheckupSettings,
    Complaint,
    Known,
    calibrate,
    diagnose,
    joint_figures,
    measure,
)
from pneumarm.checkup.figures import JOINT_HEADER, MUSCLE_HEADER, joint_row, muscle_row
from pneumarm.commands.asking import AtTerminal, asked_for, calibrated, missing_of, resting
from pneumarm.commands.common import Json, Measuring, Settings
from pneumarm.console import say, show, table
from pneumarm.errors import ArmUnsound, UnusableInput
from pneumarm.files import make_folder, require_folder, require_output, write_text
from pneumarm.progress import Display, progress
from pneumarm.transitions.window import QUANTITIES


def measured_arm(opened: Arm, settings: CheckupSettings, display: Display = progress) -> Checkup:
    """Return what a check-up of ``opened`` measures, with progress."""
    with display("checking") as report:
        return measure(opened, settings, progress=report)


def check_(
    arm: str,
    /,
    *,
    out: Path | None = None,
    strict: bool = False,
    seed: int = 0,
    settings: Annotated[CheckupSettings, Measuring] = CheckupSettings(),
    json: Json = False,
) -> None:
    """Move an arm gently, a muscle at a time, and say what is wrong with it. Its joints must be free to move.

    It takes about two minutes of the arm's time, and half a minute more for each further joint.

    The exit code is 0 whatever it finds, because the check was done; with ``--strict`` it is 1 if anything is wrong.

    Parameters
    ----------
    arm
        virtual, virtual:seed=N, serial:PORT or python:module:callable; ``,spec=arm.toml`` names a calibration, and
        the arm is compared with its sound state there.
    out
        Folder for a page with curves; created if it does not exist.
    strict
        Exit with 1 where something is wrong with the arm, for scripts.
    seed
        Random seed of a virtual arm's noise.
    """
    if out is not None:
        require_output(out)
    with open_arm(arm, seed) as opened:
        checkup = measured_arm(opened, settings)
    sound = None
    if isinstance(opened, CorrectedArm):
        sound = opened.known.sound
        if opened.arm.spec.name not in (opened.spec.name, "arm"):
            say(f"The spec is of {opened.spec.name}; this arm is {opened.arm.spec.name}.")
    findings = diagnose(checkup, sound)
    figures = [joint_figures(checkup, j) for j in range(len(checkup.joints))]
    timing = _timing(checkup)
    if out is not None:
        from pneumarm.report.checkup import checkup_page

        make_folder(out)
        write_text(out / "checkup.html", checkup_page(checkup, findings, sound))
        say(f"page: {out / 'checkup.html'}")
    places = [(j, m) for j in range(len(figures)) for m in range(2)]
    result = {
        "healthy": not findings,
        "findings": [finding._asdict() for finding in findings],
        "timing_ms": timing,
        "joints": [asdict(joint) for joint in figures],
        "sound": None if sound is None else asdict(sound),
    }

    def rows() -> list[Any]:
        of_muscles = zip(MUSCLE_HEADER, *(muscle_row(figures[j], j, m, sound) for j, m in places), strict=True)
        of_joints = zip(JOINT_HEADER, *(joint_row(figure, checkup.spec) for figure in figures), strict=True)
        verdict: Sequence[str] = [str(finding) for finding in findings] or ["Nothing is wrong with it."]
        return [
            table(("", *(f"joint {j + 1}, muscle {m + 1}" for j, m in places)), list(of_muscles), arm),
            table(("", *(f"joint {j + 1}" for j in range(len(figures)))), list(of_joints)),
            table(("time [ms]", ""), list(timing.items())),
            *verdict,
        ]

    show(result, json, rows)
    if strict and findings:
        raise ArmUnsound(f"{arm}: {len(findings)} thing(s) wrong: {', '.join(one.kind for one in findings)}")


def _timing(checkup: Checkup) -> dict[str, float]:
    """Return quantiles of the arm's answers and of its control periods [ms]; a reading is one round trip."""
    timing = checkup.timing
    named = {"round trip": timing.read, "set and read": timing.set_and_read, "control period": timing.periods}
    return {
        f"{name}, {word}": round(1e3 * float(np.quantile(values, share)), 4)
        for name, values in named.items()
        for word, share in (("p50", 0.5), ("p99", 0.99))
    }


def calibrate_(
    arm: str,
    /,
    *,
    out: Path,
    angles: tuple[tuple[float, float], ...] = (),
    counts_per_degree: float | None = None,
    supply: float | None = None,
    counts_per_bar: float | None = None,
    seed: int = 0,
    settings: Annotated[CheckupSettings, Measuring] = CheckupSettings(),
    json: Json = False,
) -> None:
    """Measure what an arm's counts mean and what it does while it is sound, and write that to a file.

    ``,spec=FILE`` behind the arm's name then uses the file with any command. The command asks what the counts of an
    arm on a serial port mean, unless options or a ``,spec=FILE`` say it; other arms know it themselves.

    Parameters
    ----------
    arm
        virtual, virtual:seed=N, serial:PORT or python:module:callable.
    out
        File to write, arm.toml.
    angles
        Angles of the joint with muscle 2 full and with muscle 1 full, by a protractor [degrees]; once for all joints,
        or once for each.
    counts_per_degree
        ... or counts of the angle's sensors per degree: for a potentiometer on the joint's axis 1023 divided by its
        electrical angle in degrees.
    supply
        Pressure of the supply by its manometer, which full muscles reach [bar gauge].
    counts_per_bar
        ... or counts of the pressure sensors per bar, by their data sheet.
    seed
        Random seed of a virtual arm's noise.
    """
    require_folder(out)
    known = Known(angles, counts_per_degree, supply, counts_per_bar)
    missing = missing_of(arm, known)
    asking = sys.stdin.isatty() and not json
    if missing and not asking:
        raise UnusableInput(f"{arm}: nobody said what its counts mean; give {' and '.join(missing)}")
    with open_arm(arm, seed) as opened:
        if isinstance(opened, CorrectedArm) and not opened.known.correction.is_none:
            raise UnusableInput(f"{arm} is calibrated already; leave spec= out, or give a spec without corrections")
        checkup = measured_arm(opened, settings)
        findings = diagnose(checkup)
        if blocking := to_mend(findings):
            raise UnusableInput(f"{arm}: mend it before you calibrate it. {' '.join(map(str, blocking))}")
        for finding in findings:
            say(str(finding))
        if missing:
            guard, person = guarded(opened), AtTerminal()
            known = asked_for(guard, checkup, known, person)
            calibration, known = calibrated(checkup, known, person, resting(guard))
        else:
            calibration = calibrate(checkup, known)
    save_arm_file(calibration.file, out)
    for line in told_of(calibration, known):
        say(line)
    result = {
        "spec": asdict(calibration.file.spec),
        "correction": asdict(calibration.file.correction),
        "linearised_residual_degrees": list(calibration.residual),
        "sound": None if calibration.file.sound is None else asdict(calibration.file.sound),
    }
    rows = [
        (name.replace("_", " "), value)
        for name, value in asdict(calibration.file.spec).items()
        if value not in (None, ())
    ]
    show(result, json, lambda: [table((str(out), ""), rows)])


def told_of(calibration: ArmCalibration, known: Known) -> Iterator[str]:
    """Yield lines on what a calibration by what was ``known`` has found."""
    spec = calibration.file.spec
    sources = ("by data sheet", "by protractor", "by manometer", "as it was")
    angle = sources[0 if known.counts_per_degree else 1 if known.angles else 3]
    pressure = sources[0 if known.counts_per_bar else 2 if known.supply else 3]
    yield f"angle: {spec.counts_per_degree:.3f} counts per degree, {angle}"
    yield f"pressure: {spec.counts_per_bar:.1f} counts per bar, {pressure}"
    for j, residual in enumerate(calibration.residual):
        if residual is not None:
            yield f"joint {j + 1}: the potentiometer is not linear; linearised off by {residual:.2f} degrees (rms)"


def to_mend(findings: Sequence[Complaint]) -> list[Complaint]:
    """Return which of the ``findings`` of a check-up have to be mended before an arm can be calibrated."""
    return [finding for finding in findings if finding.kind not in _NO_HINDRANCE]


_NO_HINDRANCE = ("angle logarithmic", "low supply", "rising supply", "leak", "noise", "noise not white", "jitter")
"""Findings with which the sensors can be calibrated all the same."""


def errors_(
    *,
    out: Path,
    seed: int = 0,
    settings: Annotated[RunsSettings, Settings] = RunsSettings(),
    json: Json = False,
) -> None:
    """Show what the errors of the thesis' appendix A look like: a virtual arm with and without each, on one page.

    Parameters
    ----------
    out
        Page to write, errors.html.
    seed
        Which virtual arm; 0 is the nominal one.
    """
    from pneumarm.appendix_a.errors_page import errors_page
    from pneumarm.appendix_a.playing_errors import play_errors

    require_folder(out)
    with progress("playing the errors") as report:
        errors = play_errors(seed, settings, progress=report)
    write_text(out, errors_page(errors, f"virtual:seed={seed}" if seed else "the nominal virtual arm"))
    say(f"page: {out}")
    result = {
        error.words.title: {
            case.name: {
                "checkup": list(case.complaints),
                "monitor": list(case.monitor),
                "error": dict(zip(QUANTITIES, case.residue.std(axis=0).mean(axis=0).tolist(), strict=True)),
            }
            for case in error.cases
        }
        for error in errors
    }
    rows = [
        (title, name, " ".join(said["checkup"]) or "-", " ".join(said["monitor"]) or "-")
        for title, cases in result.items()
        for name, said in cases.items()
    ]
    show(result, json, lambda: [table(("error", "run", "check-up", "monitor"), rows)])


def sensors_(arm: str, /, *, seconds: float = 60.0, every: float = 0.2, json: Json = False) -> None:
    """Show the sensors' readings, with all valves closed: turn the joint by hand, and its angle must follow.

    Parameters
    ----------
    arm
        virtual, virtual:seed=N, serial:PORT or python:module:callable.
    seconds
        For how long [s]; Ctrl-C ends it sooner.
    every
        Time between two lines [s].
    """
    if not (0 < seconds <= 86400 and 0.01 <= every <= 60):
        raise UnusableInput(f"sensors are shown for up to 86400 s, every 0.01 to 60 s, got {seconds}, {every}")
    seen: list[Reading] = []
    with open_arm(arm) as opened, suppress(KeyboardInterrupt):
        guard, spec = guarded(opened), opened.spec
        say_board(opened)
        guard.set_valves(np.zeros_like(guard.applied))
        begin = guard.read().time
        while (reading := guard.read()).time < begin + seconds:
            seen.append(reading)
            if not json:
                print(f"{reading.time - begin:7.1f} s   {_sensed(reading, spec)}", flush=True)
            guard.wait(every)
    rows = _extremes(seen, spec) if seen else []
    header = ("joint", "sensor", "unit", "lowest", "highest")
    show({"sensors": rows}, json, lambda: [table(header, [list(row.values()) for row in rows])])


def say_board(opened: Arm) -> None:
    """Say what the board of an arm has, and what of it is in use; nothing of an arm without a board."""
    if unwrapped(opened, SerialArm) is None:
        return
    spec = opened.spec
    sensors = spec.joints * (1 + (spec.muscles if spec.pressure_sensors else 0))
    more = f" and {len(spec.sensors)} of {EXTRAS} extra channels" if spec.sensors else ""
    other = (
        "" if spec.joints == JOINTS else "; for both write joints = 2 in [spec] of arm.toml and add ,spec=arm.toml"
    )
    say(
        f"In use: {spec.joints} of the board's {JOINTS} joints, with {2 * spec.joints * spec.muscles} of its "
        f"{2 * MUSCLES} valves and {sensors} of its {JOINTS + MUSCLES} sensors{more}{other}."
    )


def _extremes(seen: Sequence[Reading], spec: ArmSpec) -> list[dict[str, Any]]:
    """Return the lowest and the highest that each sensor said in the readings ``seen``, at least one."""
    counts = np.array([np.column_stack([reading.angle, reading.pressure]) for reading in seen])
    names = ("angle", "pressure 1", "pressure 2") if spec.pressure_sensors else ("angle",)
    found = [(j + 1, name, "counts", counts[:, j, k]) for j in range(spec.joints) for k, name in enumerate(names)]
    further = np.array([measured(reading, spec.further) for reading in seen])
    for name, values in zip(spec.further, further.T, strict=True):
        _, joint, sensor = name.split("_", 2)
        found.append((int(joint), sensor.replace("_", " "), unit_of(name), values))
    return [
        {"joint": joint, "sensor": name, "unit": unit, "lowest": values.min(), "highest": values.max()}
        for joint, name, unit, values in found
    ]


def _sensed(reading: Reading, spec: ArmSpec) -> str:
    """Return what the sensors say in degrees and bar, in counts behind it, then what further sensors say."""
    degrees, bar = spec.degrees(reading.angle), spec.bar(reading.pressure)
    muscles = range(2 if spec.pressure_sensors else 0)
    joints = [
        f"joint {j + 1}: {degrees[j]:z6.1f}° ({reading.angle[j]:4.0f})"
        + "".join(f"  {bar[j, m]:z5.2f} bar ({reading.pressure[j, m]:4.0f})" for m in muscles)
        for j in range(spec.joints)
    ]
    further = zip(spec.further, measured(reading, spec.further), strict=True)
    return "   ".join(
        [*joints, *(f"{name.replace('_', ' ')}: {value:.2f} {unit_of(name)}" for name, value in further)]
    )


def valves_(arm: str, /, *, open_for: float = 0.3, pause: float = 1.0, json: Json = False) -> None:
    """Click every valve, one by one, and name it: with the air off, to check by eye and ear that all are wired right.

    The guard permits a valve to open or keeps it closed at a limit. Whether it did open only you can hear.

    Parameters
    ----------
    arm
        virtual, virtual:seed=N, serial:PORT or python:module:callable.
    open_for
        How long each is open [s].
    pause
        How long all are closed after each [s].
    """
    if not (0 < open_for <= 5 and 0 <= pause <= 60):
        raise UnusableInput(f"a valve can be open for up to 5 s with pauses of up to 60 s, got {open_for}, {pause}")
    clicked = []
    with open_arm(arm) as opened:
        guard = guarded(opened)
        say_board(opened)
        guard.set_valves(np.zeros_like(guard.applied))
        guard.read()
        for valve in valves_of(opened.spec):
            say(str(valve))
            clicked.append({"valve": str(valve), "permitted": click(guard, valve, open_for)})
            guard.wait(pause)
    show(
        {"clicked": clicked},
        json,
        lambda: [table(("valve", "the guard permits it"), [[*c.values()] for c in clicked])],
    )


class Valve(NamedTuple):
    """A valve of an arm; numbers are from 0."""

    joint: int
    muscle: int
    value: int
    """+1 for the inlet, -1 for the exhaust."""

    def __str__(self) -> str:
        kind = "inlet" if self.value > 0 else "exhaust"
        return f"joint {self.joint + 1}, muscle {self.muscle + 1}, {kind}"


def valves_of(spec: ArmSpec) -> list[Valve]:
    """Return all valves of an arm, in the order in which they click."""
    return [Valve(j, m, value) for j in range(spec.joints) for m in range(spec.muscles) for value in (1, -1)]


def click(guard: GuardedArm, valve: Valve, open_for: float) -> bool:
    """Open a ``valve`` for so long [s] and close it, all others closed; return whether the guard let it be opened."""
    closed = np.zeros_like(guard.applied)
    wanted = closed.copy()
    wanted[valve.joint, valve.muscle] = valve.value
    guard.set_valves(wanted)
    guard.wait(open_for)
    allowed = bool((guard.applied == wanted).all())
    guard.set_valves(closed)
    return allowed


def emulate_(arm: str, /, *, link: Path | None = None, seed: int = 0, json: Json = False) -> None:
    """Serve a virtual arm behind an emulated microcontroller and serial port, in real time, until interrupted.

    ``serial:PATH``, with the path that it prints, names this arm in every other command, as the port names a real
    arm. It answers by the same protocol as the firmware, with the same dead-man and limits.

    Parameters
    ----------
    arm
        virtual or virtual:seed=N, with ,faults=PLAN.toml if you like.
    link
        Path of a symbolic link to the port, for a name that stays the same; removed at the end.
    seed
        Random seed of the arm's noise.
    json
        Print one JSON object on stdout, once the port can be used, and nothing else there.
    """
    from pneumarm.arm.serial.emulate import serve

    opened = open_arm(arm, seed)
    if opened.get_state() is None:
        opened.close()
        raise UnusableInput(f"arm {arm!r}: expected a virtual arm, whose time passes only when it is asked to")

    def tell(path: str) -> None:
        say(f"{arm} is at serial:{path}, until Ctrl-C")
        if json:
            show({"port": path, "arm": f"serial:{path}"}, json, list)
        else:
            print(path)
        sys.stdout.flush()

    with suppress(KeyboardInterrupt):  # that is how it is meant to end
        serve(opened, tell, link=link)


def flash_(port: str, /, *, agent: Path | None = None, json: Json = False) -> None:
    """Write the firmware that came with this pneumarm onto an Arduino Uno or Nano, with the air off; needs avrdude.

    With an agent it is the program of ``pneumarm deploy``, by which the board moves the arm alone.

    Parameters
    ----------
    port
        Where the board is, such as /dev/ttyACM0 or serial:/dev/ttyACM0.
    agent
        The agent that the board is to move its arm with, alone.
    """
    from pneumarm.arm.serial.flash import FIRMWARE, flash
    from pneumarm.control import open_agent
    from pneumarm.control.deploy import deploy

    place = port.removeprefix("serial:")
    with TemporaryDirectory() as folder:
        program = FIRMWARE if agent is None else deploy(open_agent(agent, None), "uno", Path(folder)).hex
        baud = flash(place, program)
    show({"port": place, "baud": baud}, json, lambda: [f"The board at {place} is flashed."])
