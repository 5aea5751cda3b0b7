"""The first day by answers on standard input: each kind of wrong wiring is found on the way, with what to do."""

import os
import pty
import re
import sys
import tty
from collections.abc import Callable
from pathlib import Path
from subprocess import DEVNULL, PIPE
from threading import Event, Thread
from time import monotonic

import pytest

import setup_arms
from children import child
from pneumarm.arm import open_arm
from pneumarm.arm.serial.emulate import serve
from pneumarm.arm.spec_file import load_arm_file
from pneumarm.arm.virtual.faults import Fault, StuckValve, SwappedMuscles, SwappedValves
from pneumarm.commands import asking
from setup_arms import HandArm
from small import exit_status

ARM = "python:setup_arms:mine"
SHORT = ("--measure.rest", "3", "--measure.settle", "2")
Answer = str | Callable[[], str]
END = "the end of standard input"


class Answering:
    """Answers what is asked, by rules: a pattern, and what is answered each time, the last again and again.

    Of several that fit the last one counts; a question that none fits ends the test.
    """

    def __init__(self, arm: HandArm, monkeypatch: pytest.MonkeyPatch) -> None:
        self.arm, self.said = arm, list[str]()
        self.rules: dict[str, list[Answer]] = {
            r"press Enter|Press Enter": [""],
            r"Did the .* click": ["y"],
            r"Turn joint \d by hand": [self.turn],
            r"Stand clear of the arm": [""],
            r"Now the arm moves by itself": [END],
        }
        out, self._in = os.pipe()
        monkeypatch.setattr(sys, "stdin", open(out))  # noqa: SIM115 - as long as the test
        monkeypatch.setattr(asking, "say", self.say)
        self.now = ""

    def turn(self) -> str:
        """Turn the joint as asked."""
        joint = int(re.findall(r"joint (\d)", self.now)[0]) - 1
        self.arm.hand = {joint: 900.0 if "shortest" in self.now else 150.0}
        return ""

    def say(self, text: str) -> None:
        self.said.append(text)
        self.now = text
        if "by hand" not in text:
            self.arm.hand = {}
        for pattern, answers in reversed(self.rules.items()):
            if re.search(pattern, text):
                answer = answers[0] if len(answers) == 1 else answers.pop(0)
                line = answer if isinstance(answer, str) else answer()
                if line == END:
                    os.close(self._in)
                else:
                    os.write(self._in, f"{line}\n".encode())
                return
        if "?" in text:
            os.close(self._in)

    @property
    def told(self) -> str:
        return "\n".join(self.said)


def set_up(answering: Answering, folder: Path, *options: str) -> int | str | None:
    setup_arms.begin(answering.arm)
    return exit_status(["setup", ARM, "--out", str(folder / "arm.toml"), *SHORT, *options])


def test_a_sound_arm_is_calibrated_and_every_step_is_said_before(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    person = Answering(HandArm(), monkeypatch)
    assert set_up(person, tmp_path) == 2  # nobody answers before it learns
    clicked = re.findall(r"Did the (\w+) of muscle (\d), joint 1 click", person.told)
    assert clicked == [("inlet", "1"), ("exhaust", "1"), ("inlet", "2"), ("exhaust", "2")]
    assert [f"Stand clear: the arm moves in {s} s. Ctrl-C stops it." in person.said for s in (5, 1)] == [True, True]
    file = load_arm_file(tmp_path / "arm.toml")
    assert file.setup is None
    assert file.sound is not None
    with open_arm(f"{ARM},spec={tmp_path / 'arm.toml'}") as arm:
        assert arm.spec.counts_per_degree == pytest.approx(11.378)
    again = Answering(person.arm, monkeypatch)
    assert set_up(again, tmp_path) == 2
    assert [one for one in again.said if "?" in one or "check" in one] == []  # it goes on where it was


def mended(person: Answering) -> None:
    """Mend what is wrong with the arm."""
    person.arm.faults, person.arm.pressures_swapped = (), False
    person.arm.reversed, person.arm.crossed = set(), sorted(person.arm.crossed)


@pytest.mark.parametrize(
    ("fault", "kind", "remedy"),
    [
        (None, "pressure sensors swapped", "Swap the two pressure sensors"),
        (SwappedValves(muscle=1), "valves swapped", "Swap its inlet and exhaust wires"),
        (SwappedMuscles(), "muscles swapped", "Swap the valves of muscle 1 with those of muscle 2"),
        (StuckValve(muscle=2), "inlet stuck closed", "Check the inlet valve"),
    ],
)
def test_wrong_wires_that_nobody_noticed_are_found_by_the_check_up_and_mended(
    fault: Fault | None, kind: str, remedy: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    person = Answering(HandArm(), monkeypatch)
    person.arm.faults, person.arm.pressures_swapped = (fault,) if fault else (), fault is None

    def mend() -> str:
        if kind in person.told:
            mended(person)
        return ""

    person.rules[r"Turn the air on.*Stand clear of the arm"] = [mend]
    assert set_up(person, tmp_path) == 2
    assert person.told.count(f": {kind}: ") == 1
    assert remedy in person.told
    assert "Turn the air off and mend that; then it is checked again." in person.told
    assert load_arm_file(tmp_path / "arm.toml").setup is None


@pytest.mark.parametrize(
    ("joints", "wiring", "words"),
    [
        (1, {"reversed": {0}}, "is reversed: it fell from 873 to 123 counts. Swap the outer wires"),
        (2, {"crossed": [1, 0]}, "The sensor of joint 2 followed, not that of joint 1. Swap the wires at A0 and A3."),
    ],
)
def test_a_wrong_angle_is_found_by_hand_and_turned_again_once_it_is_mended(
    joints: int, wiring: dict[str, object], words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    person = Answering(HandArm(joints=joints), monkeypatch)
    vars(person.arm).update(wiring)

    def mend() -> str:
        mended(person)
        return "again"

    person.rules[r"Mend that and turn the joint again"] = [mend]
    person.rules[r"Turn the air on"] = [END]
    assert set_up(person, tmp_path) == 2
    assert words in person.told
    assert person.told.count("turn the joint again") == 1
    answers = load_arm_file(tmp_path / "arm.toml").setup
    assert answers is not None
    assert (answers.valves, answers.turned) == (4 * joints, joints)


def test_an_angle_that_stays_and_a_valve_that_is_silent_are_told_with_their_pins(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    person = Answering(HandArm(), monkeypatch)
    person.rules[r"Turn joint \d by hand"] = [""]
    person.rules[r"turn the joint again"] = ["again", "g"]
    person.rules[r"Did the .* click"] = ["y", "perhaps", "no", "again", "back", "yes"]
    person.rules[r"Turn the air on"] = [END]
    assert set_up(person, tmp_path) == 2
    asked = re.findall(r"Did the (\w+) of muscle (\d)", person.told)
    first = [("inlet", "1"), ("exhaust", "1"), ("exhaust", "1"), ("exhaust", "1"), ("exhaust", "1")]
    assert asked == [*first, ("inlet", "1"), ("exhaust", "1"), ("inlet", "2"), ("exhaust", "2")]
    assert "'perhaps' is none of these." in person.said
    assert "Its pin is D5." in person.told
    assert person.told.count("stays at") == 2
    assert "GND and A0" in person.told


def test_what_is_answered_is_kept_when_it_is_interrupted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupt() -> str:
        raise KeyboardInterrupt

    person = Answering(HandArm(), monkeypatch)
    person.rules[r"Did the inlet of muscle 2"] = [interrupt]
    assert set_up(person, tmp_path) == 130
    answers = load_arm_file(tmp_path / "arm.toml").setup
    assert answers is not None
    assert answers.valves == 2
    again = Answering(person.arm, monkeypatch)
    again.rules[r"Turn the air on"] = [END]
    assert set_up(again, tmp_path) == 2
    assert "going on with what it says" in again.told
    assert re.findall(r"Did the (\w+) of muscle (\d)", again.told) == [("inlet", "2"), ("exhaust", "2")]


LEARN = (
    *("--run.transitions", "1000", "--run.method", "sarsa", "--run.test-episodes", "50", "--run.fit.epochs", "5"),
    *("--run.thesis.agents", "2", "--run.thesis.max-episodes", "500", "--run.thesis.validation-episodes", "50"),
    *("--run.transfer.episodes", "3", "--run.transfer.test-episodes", "2", "--run.bound-episodes", "0"),
    *("--run.collect.actions", "100"),
)


class BlankBoard:
    """A board at a serial port, with an arm, on which there is no program before it is flashed."""

    def __init__(self, arm: HandArm, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        self.arm, self.link, self._over = arm, folder / "ttyACM0", Event()
        self._flashed, self._ready = folder / "flashed", folder / "ready"
        program = folder / "bin" / "avrdude"
        program.parent.mkdir()
        program.write_text(
            f"#!{sys.executable}\nimport pathlib, time\npathlib.Path({str(self._flashed)!r}).touch()\n"
            f"while not pathlib.Path({str(self._ready)!r}).exists():\n    time.sleep(0.05)\n"
        )
        program.chmod(0o755)
        monkeypatch.setenv("PATH", f"{program.parent}:{os.environ['PATH']}")
        self._thread = Thread(target=self._work)

    def __enter__(self) -> "BlankBoard":
        _, slave = pty.openpty()  # which nobody reads
        tty.setraw(slave)
        self.link.symlink_to(os.ttyname(slave))
        self._thread.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._over.set()
        self._thread.join()

    def _work(self) -> None:
        while not self._flashed.exists():
            if self._over.wait(0.05):
                return
        self.link.unlink()
        serve(self.arm, lambda path: self._ready.touch(), self._over.is_set, link=self.link)


@pytest.mark.soak
def test_from_a_blank_board_to_a_trained_agent_by_answers_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In real time: three minutes, of which half a minute is the check-up."""
    arm, said, began = HandArm(seed=5), list[str](), monotonic()
    out, command = tmp_path / "arm.toml", "from pneumarm.cli import main; main()"
    degrees = arm.spec.degrees

    def answer(question: str) -> str | None:
        arm.hand = {}
        if "by hand" in question:
            arm.hand = {0: 900.0 if "shortest" in question else 150.0}
        if "protractor" in question:
            return f"{degrees(arm.read().angle)[0]:.1f}"
        rules = {
            "Flash pneumarm's firmware": "y",
            "How many joints": "1",
            "Muscles a joint": "2",
            "pressure sensor?": "y",
            "Highest pressure": "",
            "manometer show": "1,0",
            "click?": "y",
            "ress Enter": "",
        }
        found = [line for words, line in rules.items() if words in question]
        assert found or "?" not in question or "nobody answered" in question, "".join(said)
        return found[0] if found else None

    with BlankBoard(arm, tmp_path, monkeypatch) as board:
        arguments = ["setup", f"serial:{board.link}", "--out", out, *SHORT, *LEARN]
        with child(sys.executable, "-c", command, *arguments, stdin=PIPE, stdout=DEVNULL) as process:
            assert process.stdin is not None
            assert process.stderr is not None
            for line in process.stderr:
                said.append(line)
                print(line, end="")
                if (given := answer(line)) is not None:
                    process.stdin.write(f"{given}\n")
                    process.stdin.flush()
            assert process.wait() == 0, "".join(said)
    file = load_arm_file(out)
    assert file.setup is None
    assert file.spec.counts_per_degree == pytest.approx(arm.spec.counts_per_degree, rel=0.03)
    assert (tmp_path / "arm-run" / "adapted.safetensors").exists()
    assert "is calibrated" in "".join(said)
    assert said[-1].startswith(f"Now drag it: pneumarm live {tmp_path / 'arm-run'} --arm serial:{board.link},spec=")
    assert monotonic() - began < 20 * 60
