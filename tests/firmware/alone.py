"""A board that drives a virtual arm alone, in the simulated microcontroller: lines in, lines out, and what it does.

    python -m tests.firmware.alone arm.agent --arm virtual:seed=1001 --goals 100

compares it with the host's controller on the same arm and goals, and prints what the program takes.
"""

import argparse
import subprocess
import tempfile
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm import Reading, guarded, open_arm
from pneumarm.arm.virtual import VirtualArm
from pneumarm.control import open_agent
from pneumarm.control.deploy import BOARDS, Built, deploy
from pneumarm.learning.servo.agent import ServoAgent
from pneumarm.moving.movement import MoveSettings, move, track
from pneumarm.moving.settling import settled_at
from pneumarm.statistics import mean_estimate
from pneumarm.task.reference import parse_reference
from tests.firmware.board import SimulatedBoard, single_conversions
from tests.firmware.chip import FREQUENCY, Chip
from tests.firmware.second_machine import SecondChip

HOLD = 2.0
"""For how long each goal is held [s]."""
SETTLING, SWING = 4.0, 12.0
"""For how long a swing is followed before it counts, and then [s]."""
SWINGS = ((0.2, 15.0), (0.5, 15.0), (1.0, 10.0))
"""Frequencies [Hz] and amplitudes [degrees]."""
PAINT = 0xC5
"""What memory is filled with, to see later how far the stack went."""
_RAM_BEGINS, _RAM_ENDS = 0x100, 0x900
_ANSWER = 0.05
"""An answer comes after the decision under way [s]."""


class Held(NamedTuple):
    """A goal that was given, and what came of it by the arm's true angle [s, degrees]."""

    settled: float | None
    rest: float


def held(times: NDArray[np.float64], off: list[float]) -> Held:
    """Return what came of a goal that the joint was ``off`` by at these ``times``."""
    error = np.array(off)[:, None]
    return Held(settled_at(times, error), float(np.abs(error[times > times[-1] - 1]).mean()))


def variables(built: Built) -> dict[str, int]:
    """Return where the program's variables are."""
    listing = subprocess.run(["avr-nm", built.hex.with_suffix(".elf")], capture_output=True, text=True, check=True)
    words = [line.split() for line in listing.stdout.splitlines()]
    return {name.split(".")[0]: int(place, 16) - 0x800000 for place, kind, name in words if kind in "bBdD"}


class Typist:
    """Types lines to a chip with the program that drives alone."""

    def __init__(self, chip: Chip | SecondChip) -> None:
        self.chip = chip

    def type(self, line: str | bytes, wait: float = _ANSWER) -> str:
        """Type a line and return the answer."""
        self.chip.received()
        self.chip.write((line.encode() if isinstance(line, str) else line) + b"\n")
        self.chip.run(wait)
        return bytes(byte for _, byte in self.chip.received()).decode().strip()


class Alone:
    """A board without a host that moves an arm; a context manager.

    Args:
        built: its program.
        arm: what it moves.
        seed: of the noise of its sensors.

    """

    def __init__(self, built: Built, arm: VirtualArm, seed: int = 0) -> None:
        self.arm = single_conversions(arm, seed)
        self.board = SimulatedBoard(self.arm, built.hex)
        self._variables = variables(built)
        self.spec, self._first = arm.spec, _RAM_BEGINS + built.memory
        for address in range(self._first, _RAM_ENDS):
            self.board.chip.poke(address, PAINT)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.board.close()

    def type(self, line: str, wait: float = _ANSWER) -> str:
        """Type a line and return the answer."""
        self.board.discard()
        self.board.write(line.encode() + b"\n")
        self.board.wait(wait)
        return self.board.read(self.board.in_waiting, 0.0).decode().strip()

    @property
    def stack(self) -> int:
        """Bytes that the stack has taken at most."""
        used = (a for a in range(self._first, _RAM_ENDS) if self.board.chip.peek(a) != PAINT)
        return _RAM_ENDS - next(used, _RAM_ENDS)

    def decisions(self) -> tuple[float, float]:
        """Return how many cycles the last decision took, and the longest."""
        words = self.type("turn").split()
        return float(words[2]) * 1e-3 * FREQUENCY, float(words[6]) * 1e-3 * FREQUENCY

    def hold(self, degrees: float, seconds: float = HOLD) -> Held:
        """Ask for a goal and return what came of it."""
        self.type(f"goto {degrees:.2f}", 0.0)
        times, off = np.arange(round(seconds / self.spec.period)) * self.spec.period, []
        for _ in times:
            self.board.wait(self.spec.period)
            off.append(float(np.degrees(self.arm.angle[0])) - degrees)
        said = self.board.read(self.board.in_waiting, 0.0).decode().strip()
        assert said == "ok", said
        return held(times, off)

    def swing(self, frequency: float, amplitude: float) -> float:
        """Ask for a swing and return its RMS error once it has gone on for a while [Hz, degrees]."""
        assert self.type(f"sine {frequency:.2f} {amplitude:.2f}") == "ok"
        off = []
        next_ = 1e-6 * int.from_bytes(self._variable("next_us"), "little")
        self.board.wait_until(next_ + self.spec.period - 0.006)  # between two decisions, not while one is made
        for _ in range(round((SWING + SETTLING) / self.spec.period)):
            self.board.wait(self.spec.period)
            phase = np.frombuffer(self._variable("phase"), np.float32)[0]
            ahead = 1e-6 * int.from_bytes(self._variable("next_us"), "little") - self.board.time
            wanted = amplitude * np.sin(phase - 2 * np.pi * frequency * ahead)
            off.append(float(np.degrees(self.arm.angle[0])) - wanted)
        return float(np.sqrt(np.mean(np.square(off[round(SETTLING / self.spec.period) :]))))

    def _variable(self, name: str) -> bytes:
        return bytes(self.board.chip.peek(self._variables[name] + i) for i in range(4))


def goals_of(agent: ServoAgent, count: int, seed: int) -> NDArray[np.float64]:
    """Return goals [degrees] that the arm can hold."""
    (low, high), random = agent.spec.degrees(agent.goal_range[0]), np.random.default_rng(seed)
    return np.asarray(low + (high - low) * random.random(count)).round(2)


def on_the_host(agent: ServoAgent, arm: VirtualArm, goals: Iterable[float]) -> Iterator[Held]:
    """Let the host's controller move an arm to the same goals."""
    spec = agent.spec
    off: list[float] = []
    settings, controller = MoveSettings(hold=HOLD, tries=1), agent.controller()
    with guarded(arm) as safe:
        for goal in goals:
            counts = [spec.counts_per_degree * goal + sum(spec.angle_range) / 2]

            def look(*_: object, goal: float = goal) -> None:
                off.append(float(np.degrees(arm.angle[0])) - goal)

            [moved] = move(safe, controller, [counts], settings, seen=look)
            yield held(moved.time[: len(off)], off)
            off.clear()


def swung_by_the_host(agent: ServoAgent, arm: VirtualArm) -> Iterator[float]:
    """Let the host's controller follow the same swings; give their RMS errors [degrees]."""
    controller, off = agent.controller(), []

    def look(_: Reading, wanted: NDArray[np.float64]) -> None:
        off.append(float(np.degrees(arm.angle[0])) - float(agent.spec.degrees(wanted)[0]))

    with guarded(arm) as safe:
        for frequency, amplitude in SWINGS:
            off.clear()
            reference = parse_reference(f"sine:{frequency}Hz,{amplitude}deg", agent.spec)
            track(safe, controller, reference, SETTLING + SWING, seen=look)
            counted = off[-round(SWING / agent.spec.period) :]
            yield float(np.sqrt(np.mean(np.square(counted))))


def main() -> None:
    """Compare both, and print it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("agent", type=Path)
    parser.add_argument("--arm", default="virtual", help="the virtual arm that it was trained for")
    parser.add_argument("--goals", type=int, default=50)
    parser.add_argument("--seed", type=int, default=0, help="of goals and noise")
    options = parser.parse_args()
    agent, arms = open_agent(options.agent), [open_arm(options.arm, options.seed) for _ in range(2)]
    assert isinstance(agent, ServoAgent)
    first, second = arms
    assert isinstance(first, VirtualArm)
    assert isinstance(second, VirtualArm)
    goals, found, taken = goals_of(agent, options.goals, options.seed), [], []
    with tempfile.TemporaryDirectory() as folder:
        built = deploy(agent, "uno", Path(folder))
        with Alone(built, first, options.seed) as alone:
            alone.board.wait(0.1)
            alone.type("arm")
            for goal in goals:
                found.append(alone.hold(goal))
                taken.append(alone.decisions())
            swings = [alone.swing(*one) for one in SWINGS]
            stack = alone.stack
    both: dict[str, list[Held]] = {"board": found, "host": list(on_the_host(agent, second, goals))}
    third = open_arm(options.arm, options.seed)
    assert isinstance(third, VirtualArm)
    for (frequency, far), here, there in zip(SWINGS, swings, swung_by_the_host(agent, third), strict=True):
        print(f"{frequency} Hz, {far} deg: RMS error on the board {here:.2f} deg, on the host {there:.2f} deg")
    for name, these in both.items():
        times = [one.settled for one in these if one.settled is not None]
        rest = np.mean([one.rest for one in these])
        print(f"{name}: {len(times)} of {len(goals)} settled, median {np.median(times):.2f} s, rest {rest:.3f} deg")
    print("on the board, with 95 % intervals:")
    for name, of in (("points fewer settle", lambda one: 100.0 * (one.settled is None)), ("deg rest", _rest)):
        more = mean_estimate([of(a) - of(b) for a, b in zip(both["board"], both["host"], strict=True)])
        print(f"  {more.mean:+.3f} {name} ({more.low:+.3f} to {more.high:+.3f})")
    cycles = np.array(taken)
    print(f"{cycles[:, 0].mean():.0f} cycles a decision, at most {cycles[:, 1].max():.0f}, interrupts included")
    print(f"{built.flash} bytes of flash, {built.memory} of RAM, {stack} of stack at most of {BOARDS['uno'].stack}")


def _rest(one: Any) -> float:
    return float(one.rest)


if __name__ == "__main__":
    main()
