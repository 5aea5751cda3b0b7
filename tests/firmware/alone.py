"""A board that drives a virtual arm alone, in the simulated microcontroller: lines in, lines out, and what it does.

    python -m tests.firmware.alone arm.agent --arm virtual:seed=1001 --goals 100

compares it with the host's controller on the same arm and goals, and prints what the program takes.
"""

import argparse
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from pneumarm.arm import guarded, open_arm
from pneumarm.arm.virtual import VirtualArm
from pneumarm.control import open_agent
from pneumarm.control.deploy import Built, deploy
from pneumarm.learning.servo.agent import ServoAgent
from pneumarm.moving.movement import MoveSettings, move
from pneumarm.moving.settling import settled_at
from pneumarm.statistics import mean_estimate
from tests.firmware.board import SimulatedBoard, single_conversions
from tests.firmware.chip import FREQUENCY

HOLD = 2.0
"""For how long each goal is held [s]."""
PAINT = 0xC5
"""What memory is filled with, to see later how far the stack went."""
_MEMORY_ENDS = 0x900
_ANSWER = 0.05
"""An answer comes after the decision under way [s]."""


class Held(NamedTuple):
    """A goal that was given, and what came of it [s, degrees]."""

    settled: float | None
    rest: float


class Alone:
    """A board without a host; a context manager.

    Args:
        built: its program.
        arm: what it moves.
        seed: of the noise of its sensors.

    """

    def __init__(self, built: Built, arm: VirtualArm, seed: int = 0) -> None:
        self.board = SimulatedBoard(single_conversions(arm, seed), built.hex)
        self.spec, self._first = arm.spec, 0x100 + built.memory
        for address in range(self._first, _MEMORY_ENDS):
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
        for address in range(self._first, _MEMORY_ENDS):
            if self.board.chip.peek(address) != PAINT:
                return _MEMORY_ENDS - address
        return 0

    def decisions(self) -> tuple[float, float]:
        """Return how long the last decision took and the longest [cycles]."""
        words = self.type("turn").split()
        return tuple(float(words[place]) * 1e-3 * FREQUENCY for place in (2, 6))  # type: ignore[return-value]

    def hold(self, degrees: float, seconds: float = HOLD) -> Held:
        """Ask for a goal and return what came of it."""
        self.type(f"goto {degrees:.2f}", 0.0)
        times, off = np.arange(round(seconds / self.spec.period)) * self.spec.period, []
        for _ in times:
            self.board.wait(self.spec.period)
            arm = self.board.arm
            assert arm is not None
            off.append(self.spec.degrees(arm.read().angle) - degrees)
        said = self.board.read(self.board.in_waiting, 0.0).decode().strip()
        assert said == "ok", said
        error = np.array(off)
        return Held(settled_at(times, error), float(np.abs(error[times > times[-1] - 1]).mean()))


def goals_of(agent: ServoAgent, count: int, seed: int) -> NDArray[np.float64]:
    """Return goals [degrees] that the arm can hold."""
    (low, high), random = agent.spec.degrees(agent.goal_range[0]), np.random.default_rng(seed)
    return np.asarray(low + (high - low) * random.random(count)).round(2)


def on_the_host(agent: ServoAgent, arm: VirtualArm, goals: Iterable[float]) -> Iterator[Held]:
    """Let the host's controller move an arm to the same goals."""
    counts = [agent.spec.counts_per_degree * goal + sum(agent.spec.angle_range) / 2 for goal in goals]
    with guarded(arm) as safe:
        for moved in move(safe, agent.controller(), [[one] for one in counts], MoveSettings(hold=HOLD, tries=1)):
            time = None if moved.time_settled is None else moved.time_settled - moved.time_start
            yield Held(time, float(moved.rest_error.max()))


def main() -> None:
    """Compare both, and print it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("agent", type=Path)
    parser.add_argument("--arm", default="virtual", help="the virtual arm that it was trained for")
    parser.add_argument("--goals", type=int, default=50)
    parser.add_argument("--seed", type=int, default=0, help="of goals and noise")
    options = parser.parse_args()
    agent, arms = open_agent(options.agent, None), [open_arm(options.arm, options.seed) for _ in range(2)]
    if not isinstance(agent, ServoAgent) or not all(isinstance(arm, VirtualArm) for arm in arms):
        parser.error("a servo and its virtual arm are wanted")
    goals = goals_of(agent, options.goals, options.seed)
    built = deploy(agent, "uno", Path("build"))
    with Alone(built, arms[0], options.seed) as alone:  # type: ignore[arg-type]
        alone.board.wait(0.1)
        alone.type("arm")
        found = {"board": [], "host": list(on_the_host(agent, arms[1], goals))}  # type: ignore[arg-type, var-annotated]
        taken = []
        for goal in goals:
            found["board"].append(alone.hold(goal))
            taken.append(alone.decisions())
        cycles, stack = np.array(taken), alone.stack
    for name, held in found.items():
        settled = np.array([one.settled is not None for one in held])
        times = [one.settled for one in held if one.settled is not None]
        rest = np.mean([one.rest for one in held])
        print(f"{name}: {100 * settled.mean():.1f} % settled, median {np.median(times):.2f} s, rest {rest:.3f} deg")
    pairs = zip(found["board"], found["host"], strict=True)
    less = np.array([float(b.settled is None) - float(a.settled is None) for a, b in pairs])
    found_less = mean_estimate(less)
    print(f"on the board {100 * found_less.mean:.2f} points fewer settle ({100 * found_less.low:.2f} to ", end="")
    print(f"{100 * found_less.high:.2f} at 95 %)")
    print(f"{cycles[:, 0].mean():.0f} cycles a decision, at most {cycles[:, 1].max():.0f}, interrupts included")
    print(f"{built.flash} bytes of flash, {built.memory} of RAM, {stack} of stack at most")


if __name__ == "__main__":
    main()
