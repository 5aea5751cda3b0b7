"""``pneumarm setup``: the first day of an arm, from a blank board to an agent, by questions and answers."""

import secrets
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter
from numpy.typing import NDArray

from pneumarm.arm import ArmSpec, GuardedArm, Reading, guarded, open_arm
from pneumarm.arm.serial.flash import flash
from pneumarm.arm.serial.port import SerialPort, boards
from pneumarm.arm.serial.protocol import JOINTS
from pneumarm.arm.spec_file import Answers, ArmFile, load_arm_file, save_arm_file
from pneumarm.checkup import Checkup, CheckupSettings, Known, diagnose
from pneumarm.commands.arm_ import Valve, click, measured_arm, to_mend, told_of, valves_of
from pneumarm.commands.asking import SUPPLY, AtTerminal, Bars, Person, asked_for, calibrated, resting, vent
from pneumarm.commands.common import Json, Measuring
from pneumarm.commands.live_ import LOCAL, live_
from pneumarm.commands.on_page import OnPage
from pneumarm.commands.run_ import run_
from pneumarm.console import say
from pneumarm.errors import ArmFailure, PneumarmError, UnusableInput
from pneumarm.files import require_folder
from pneumarm.live.questions import QuestionPage
from pneumarm.run import RunSettings

_OPEN, _BETWEEN = 0.3, 0.3  # s that a valve is open when it clicks, and closed between two clicks
_FILL = 3.0  # s after which a muscle has the supply's pressure
_COUNTED = 5  # s counted down before anything moves
_LEAST_TURN = 0.05  # of the sensor's range: a joint that is turned by hand from end to end turns more
_ELECTRICAL = (30.0, 3600.0)  # degrees that potentiometers turn
_FIRST_PIN = 4  # of the board: D4 is the first inlet, D5 its exhaust, and so on (firmware/PROTOCOL.md)
_ANGLE_PINS = ("A0", "A3")


def setup_(
    arm: str | None = None,
    /,
    *,
    out: Path = Path("arm.toml"),
    folder: Path | None = None,
    page: bool = False,
    host: str = "127.0.0.1",
    port: int = 8642,
    seed: int = 0,
    settings: Annotated[CheckupSettings, Measuring] = CheckupSettings(),
    learning: Annotated[RunSettings, Parameter(name="run")] = RunSettings(),
    json: Json = False,
) -> None:
    """Guide you through an arm's first day: board, valves, sensors, check-up, calibration, learning.

    It asks questions and waits for the answers on standard input. Nothing moves before it has said so and counted
    down. A second call goes on where the first one ended; Ctrl-C closes all valves.

    Parameters
    ----------
    arm
        serial:PORT, or any other arm, to rehearse; found on the USB ports if it is left out.
    out
        File to write, arm.toml: what is answered, and in the end the calibrated arm.
    folder
        Folder of the run in which the arm learns; by default named after the file, arm-run.
    page
        Ask on a page in the browser, such as that of a phone beside the arm, and go on there to `pneumarm live`.
    host
        Address of the page: that of this machine, or 0.0.0.0, for a phone; its address then holds a token.
    port
        Port of the page.
    seed
        Random seed of a virtual arm's noise.
    """
    require_folder(out)
    if arm is not None and ",spec=" in arm:
        raise UnusableInput(f"{arm}: leave out spec=; {out} is written here, and read if it is there")
    run = folder or out.with_name(f"{out.stem}-run")
    if page:
        token = None if host in LOCAL else secrets.token_urlsafe(12)
        asking = OnPage(QuestionPage(host, port, token))
        with asking.page.served():
            say(f"open {asking.page.url}")
            day = _persistently(asking, lambda: _calibrated_day(arm, out, seed, settings, asking))
        name, port = day.calibrated_name, asking.page.port
        live_(str(run), arm=name, host=host, port=port, token=token, browser=False, seed=seed, json=json)
        return
    day = _calibrated_day(arm, out, seed, settings, AtTerminal())
    day.learn(run, learning, json)
    say(f"Now drag it: pneumarm live {run} --arm {day.calibrated_name}")


def _calibrated_day(arm: str | None, out: Path, seed: int, settings: CheckupSettings, person: Person) -> "_FirstDay":
    """Return the first day of an arm when that is calibrated."""
    day = _FirstDay(arm or _found(person), out, seed, settings, person)
    day.put_firmware_on()
    day.describe()
    day.try_wires()
    day.calibrate()
    return day


def _persistently(person: OnPage, work: Callable[[], "_FirstDay"]) -> "_FirstDay":
    """Return what ``work`` returns; after a failure, or a stop on the page, it goes on when somebody says so."""
    failed = False
    while True:
        person.page.stopped.clear()
        try:
            if failed:
                person.show(())
                person.line("Go on where that was? Then press Enter.")
            return work()
        except PneumarmError as error:
            person.say(str(error))
        except KeyboardInterrupt:
            if not person.page.stopped.is_set():
                raise
            person.say("Stopped: everything is vented.")
        failed = True


def _found(person: Person) -> str:
    """Return the name of the arm at a USB port, chosen by a person where there are several."""
    found = boards()
    if not found:
        raise UnusableInput(
            "no board is at any USB port; plug it in, or name another arm: pneumarm setup serial:PORT"
        )
    listed = "; ".join(f"{number}: {path} ({what})" for number, (path, what) in enumerate(found, 1))
    number = 1 if len(found) == 1 else round(person.number(f"Which is the board? {listed}", (1, len(found))))
    return f"serial:{found[number - 1][0]}"


class _FirstDay:
    """What is known of an arm so far, kept in its file after every answer."""

    def __init__(self, name: str, out: Path, seed: int, settings: CheckupSettings, person: Person) -> None:
        self.name, self.out, self.seed, self.person = name, out, seed, person
        self.calibrated_name = f"{name},spec={out}"
        self.asks = name.startswith("serial:")
        """Whether only a person can tell about the arm; others know themselves."""
        # What the manometer shows is compared with muscles that are full.
        self.settings = replace(settings, fill=max(settings.fill, _FILL)) if self.asks else settings
        self.begun = out.exists()
        self.file = load_arm_file(out) if self.begun else ArmFile(ArmSpec(name=name), setup=Answers())
        if self.begun:
            person.say(f"{out} is there already: going on with what it says.")

    @property
    def calibrated(self) -> bool:
        """Whether nothing is to be asked any more."""
        return self.file.setup is None

    @property
    def answers(self) -> Answers:
        """What was answered so far."""
        return self.file.setup or Answers()

    def keep(self, spec: ArmSpec, answers: Answers) -> None:
        """Keep what was answered."""
        self.file = ArmFile(spec, setup=answers)
        save_arm_file(self.file, self.out)

    def _note(self, **answered: object) -> None:
        self.keep(self.file.spec, replace(self.answers, **answered))  # type: ignore[arg-type]

    # ---- the board

    def put_firmware_on(self) -> None:
        """See to it that pneumarm's firmware answers from the board."""
        if not self.asks:
            return
        path = self.name.removeprefix("serial:").partition(",")[0]
        SerialPort(path).close()  # raises what is wrong with the port
        while True:
            try:
                open_arm(self.name, self.seed).close()
                break
            except (ArmFailure, UnusableInput) as error:
                self.person.say(str(error))
            question = "Flash pneumarm's firmware onto this board now? The air must be off."
            if self.person.choice(question, ("yes", "no")) == "no":
                raise UnusableInput(f"{self.name}: nothing goes on without pneumarm's firmware on the board")
            flash(path)
        self.person.say(f"The board at {path} answers.")

    # ---- what it is

    def describe(self) -> None:
        """Ask what the arm is, question by question, from the first one that is not answered."""
        if not self.asks and not self.begun:
            with open_arm(self.name, self.seed) as opened:
                self.keep(opened.spec, Answers())
        if not self.asks or self.calibrated:
            return
        questions = (self._ask_joints, self._ask_muscles, self._ask_sensors, self._ask_highest, self._ask_supply)
        for number, question in enumerate(questions, 1):
            if self.answers.questions < number:
                spec, answers = question(self.file.spec, self.answers)
                self.keep(spec, replace(answers, questions=number))

    def _ask_joints(self, spec: ArmSpec, answers: Answers) -> tuple[ArmSpec, Answers]:
        joints = self.person.number(f"How many joints does the arm have, 1 to {JOINTS}?", (1, JOINTS))
        return replace(spec, joints=round(joints)), answers

    def _ask_muscles(self, spec: ArmSpec, answers: Answers) -> tuple[ArmSpec, Answers]:
        muscles = self.person.number("Muscles a joint: 2, or 1 against a spring?", (1, 2))
        return replace(spec, muscles=round(muscles)), answers

    def _ask_sensors(self, spec: ArmSpec, answers: Answers) -> tuple[ArmSpec, Answers]:
        if self.person.choice("Does each muscle have a pressure sensor?", ("yes", "no")) == "yes":
            return replace(spec, pressure_sensors=True), answers
        question = "Then nothing but the supply limits the pressure. Can its highest pressure burst a muscle?"
        while self.person.choice(question, ("yes", "no")) == "yes":
            self.person.say("Turn the reducer down, and put a relief valve behind it that protects the muscles.")
        return replace(spec, pressure_sensors=False, safe_supply=True), answers

    def _ask_highest(self, spec: ArmSpec, answers: Answers) -> tuple[ArmSpec, Answers]:
        usual = spec.max_pressure
        question = f"Highest pressure that the muscles may have [bar]? (Enter: {usual:g})"
        return replace(spec, max_pressure=self.person.number(question, SUPPLY, usual=usual)), answers

    def _ask_supply(self, spec: ArmSpec, answers: Answers) -> tuple[ArmSpec, Answers]:
        question = f"Set the supply to {spec.max_pressure:g} bar or less. What does its manometer show [bar]?"
        supply = self.person.number(question, (SUPPLY[0], spec.max_pressure))
        if spec.pressure_sensors and spec.muscles == 2:
            return spec, replace(answers, supply=supply)
        question = "Electrical angle of the potentiometers, by their data sheet [degrees]? (Enter: 270)"
        counts = np.ptp(spec.angle_range) / self.person.number(question, _ELECTRICAL, usual=270.0)
        return replace(spec, counts_per_degree=float(counts)), replace(answers, supply=supply)

    # ---- wires

    def try_wires(self) -> None:
        """Click the valves and have the joints turned by hand, as far as that was not done."""
        if self.calibrated:
            return
        with open_arm(self.name, self.seed, self.out) as opened:
            guard = guarded(opened)
            self._click_valves(guard, valves_of(opened.spec))
            vent(guard)
            self._turn_joints(guard)

    def _click_valves(self, guard: GuardedArm, valves: list[Valve]) -> None:
        number = self.answers.valves
        if number < len(valves):
            question = "Turn the air off and the valves' power on, then press Enter. Each valve clicks twice."
            self.person.line(question, resting(guard))
        while number < len(valves):
            valve = valves[number]
            guard.despite_losses(lambda valve=valve: _click_twice(guard, valve))  # type: ignore[misc]
            kind = "inlet" if valve.value > 0 else "exhaust"
            question = f"Did the {kind} of muscle {valve.muscle + 1}, joint {valve.joint + 1} click?"
            answer = self.person.choice(question, ("yes", "no", "again", "back"), resting(guard))
            number = {"yes": number + 1, "back": max(number - 1, 0)}.get(answer, number)
            self._note(valves=number)
            if answer == "no":
                pin = _FIRST_PIN + 2 * (2 * valve.joint + valve.muscle) + (valve.value < 0)
                self.person.say(
                    f"Its pin is D{pin}. Check the wire from there to the MOSFET, the valve's plug and its "
                    "power. If another valve clicked, swap the wires of the two."
                )
                self.person.line("Press Enter and it clicks again.", resting(guard))

    def _turn_joints(self, guard: GuardedArm) -> None:
        joint = self.answers.turned
        while joint < guard.spec.joints:
            ends = []
            for end in ("shortest", "longest"):
                question = f"Turn joint {joint + 1} by hand to where muscle 1 is {end}, hold it and press Enter."
                ends.append(self._read_while_asking(guard, question))
            wrong = _wrong_with(guard.spec, joint, *ends)
            if wrong is not None:
                self.person.say(wrong)
                question = "Mend that and turn the joint again, or go on as it is?"
                if self.person.choice(question, ("again", "go on"), resting(guard)) == "again":
                    continue
            joint += 1
            self._note(turned=joint)

    def _read_while_asking(self, guard: GuardedArm, question: str) -> NDArray[np.float64]:
        """Return the angles (joints,) [counts] when ``question`` is answered; a terminal shows them as bars."""

        def look() -> Reading:
            guard.despite_losses(lambda: guard.wait(0.0))
            reading = guard.despite_losses(guard.read)
            self.person.show(_bars(guard.spec, reading))
            return reading

        self.person.line(question, look)
        self.person.show(())
        return guard.despite_losses(guard.read).angle

    # ---- the calibrated arm

    def calibrate(self) -> None:
        """Check the arm until nothing hinders, calibrate it and write its file, unless it is calibrated."""
        if self.calibrated:
            return
        done = replace(self.file, setup=None)
        if self.file.spec.pressure_sensors and self.file.spec.muscles == 2:
            with open_arm(self.name, self.seed, self.out) as opened:
                done = self._calibrated(guarded(opened))
        self.file = done
        save_arm_file(done, self.out)
        self.person.say(f"{self.out}: the arm is calibrated.")

    def _calibrated(self, guard: GuardedArm) -> ArmFile:
        known = Known(angles=self.answers.angles, supply=self.answers.supply)
        while True:
            checkup = self._sound(guard)
            try:
                if self.asks:
                    known = asked_for(guard, checkup, known, self.person, lambda now: self._note(angles=now.angles))
                calibration, by = calibrated(checkup, known, self.person, resting(guard))
            except UnusableInput as error:
                self.person.say(f"{error}.")
                continue
            for line in told_of(calibration, by):
                self.person.say(line)
            return calibration.file

    def _sound(self, guard: GuardedArm) -> Checkup:
        """Return the check-up of an arm with which nothing is wrong that hinders; it is mended until then."""
        at = f" at {self.answers.supply:g} bar" if self.answers.supply else ""
        while True:
            self._stand_clear(guard, f"Turn the air on{at}. The arm is checked for two minutes, muscle by muscle.")
            checkup = measured_arm(guard, self.settings, self.person.display)
            findings = diagnose(checkup)
            for finding in findings:
                self.person.say(str(finding))
            if not to_mend(findings):
                return checkup
            self.person.say("Turn the air off and mend that; then it is checked again.")

    def _stand_clear(self, guard: GuardedArm, what: str) -> None:
        """Say ``what`` comes, wait until nobody is near the arm, and count down, with everything vented."""
        vent(guard)
        self.person.line(f"{what} Stand clear of the arm and press Enter.", resting(guard))
        for left in range(_COUNTED, 0, -1):
            self.person.say(f"Stand clear: the arm moves in {left} s. Ctrl-C stops it.")
            guard.despite_losses(lambda: guard.wait(1.0))

    def learn(self, folder: Path, settings: RunSettings, json: bool) -> None:
        """Have the arm learn."""
        if not (folder / "results.json").exists():
            with open_arm(self.calibrated_name, self.seed) as opened:
                self._stand_clear(guarded(opened), "Now the arm moves by itself, for half an hour or so, and learns.")
        run_(out=folder, settings=replace(settings, arm=self.calibrated_name, seed=self.seed), json=json)


def _click_twice(guard: GuardedArm, valve: Valve) -> None:
    guard.make_ready()
    for _ in range(2):
        click(guard, valve, _OPEN)
        guard.wait(_BETWEEN)


def _wrong_with(spec: ArmSpec, joint: int, first: NDArray[np.float64], second: NDArray[np.float64]) -> str | None:
    """Return what is wrong with an angle, and what to do, by what all sensors read at its ends.

    ``first`` and ``second`` (joints,) [counts] are with muscle 1 shortest and longest; None where all is well.
    """
    turned, least = first - second, _LEAST_TURN * np.ptp(spec.angle_range)
    most = int(np.abs(turned).argmax())
    if abs(turned[joint]) >= least and most == joint:
        if turned[joint] > 0:
            return None
        return (
            f"The angle of joint {joint + 1} is reversed: it fell from {second[joint]:.0f} to {first[joint]:.0f} "
            "counts. Swap the outer wires of its potentiometer."
        )
    if abs(turned[most]) >= least:
        return (
            f"The sensor of joint {most + 1} followed, not that of joint {joint + 1}. Swap the wires at "
            f"{_ANGLE_PINS[joint]} and {_ANGLE_PINS[most]}."
        )
    return (
        f"The angle of joint {joint + 1} stays at {first[joint]:.0f} counts. Check the potentiometer's axis, and its "
        f"wires to 5V, GND and {_ANGLE_PINS[joint]}."
    )


def _bars(spec: ArmSpec, reading: Reading) -> Bars:
    """Return where each angle is in the range of its sensor."""
    low, high = spec.angle_range
    shares = np.clip((reading.angle - low) / (high - low), 0.0, 1.0).tolist()
    return [(f"joint {j + 1}", shares[j], f"{at:4.0f}") for j, at in enumerate(reading.angle)]
