"""A servo as the program of a board that drives its arm alone: written as C, built, and checked to fit."""

import re
import shutil
import subprocess
from pathlib import Path
from typing import NamedTuple

from pneumarm.errors import UnusableInput
from pneumarm.files import make_folder, write_text
from pneumarm.learning.agents import AnyAgent
from pneumarm.learning.servo.agent import ServoAgent
from pneumarm.learning.servo.as_c import as_c
from pneumarm.learning.servo.board import quantised

FIRMWARE = Path(__file__).parents[3] / "firmware"
"""Sources of the boards' programs, in a checkout."""
LONGEST = 300.0
"""Building is ended after this time [s]; it takes five."""


class Board(NamedTuple):
    """What a board has room and time for. Measured by ``python -m tests.firmware.alone``."""

    flash: int
    """Bytes that its boot loader leaves, the larger one of an older Nano."""
    memory: int
    """Bytes of RAM."""
    stack: int
    """Bytes of it that the stack takes at most, and some more."""
    a_decision: int
    """Cycles that a decision takes while a goal is held, interrupts included; a swing takes a tenth more ..."""
    a_weight: int
    """... and that it takes longer for each weight of the policy."""
    frequency: float
    """Cycles a second."""


BOARDS = {"uno": Board(30_720, 2_048, 288, 170_000, 22, 16e6)}
"""Boards by name: an Arduino Uno or Nano."""
_TIME = 0.8
"""Share of the control period that a decision may take; the rest is for lines and for what comes late."""


class Built(NamedTuple):
    """A program for a board."""

    hex: Path
    flash: int
    """Bytes."""
    memory: int
    """Bytes of RAM, without the stack."""
    weights: int
    milliseconds: float
    """That a decision takes while a goal is held, about."""


def deploy(agent: AnyAgent, board: str, out: Path, firmware: Path = FIRMWARE) -> Built:
    """Build the program by which ``board`` moves its arm with ``agent``, in the folder ``out``.

    Args:
        agent: a servo for one joint.
        board: of :data:`BOARDS`.
        out: created if it does not exist.
        firmware: where the sources of the boards' programs are.

    Raises:
        UnusableInput: the agent is of no use to a board, does not fit, or something to build it with is missing.

    """
    if board not in BOARDS:
        raise UnusableInput(f"{board}: no such board; there is {', '.join(BOARDS)}")
    has, servo = BOARDS[board], _usable(agent)
    missing = [tool for tool in ("avr-gcc", "make", "avr-size") if shutil.which(tool) is None]
    if missing:
        raise UnusableInput(f"{', '.join(missing)} missing; on Debian: apt install gcc-avr avr-libc make")
    if not (firmware / "alone").is_dir():
        raise UnusableInput(f"{firmware}: no sources of boards there; name the folder firmware/ of a checkout")
    weights = len(servo.policy)
    milliseconds = 1e3 * (has.a_decision + has.a_weight * weights) / has.frequency
    if milliseconds > 1e3 * _TIME * servo.spec.period:
        most = int((_TIME * servo.spec.period * has.frequency - has.a_decision) / has.a_weight)
        raise UnusableInput(
            f"does not fit: a decision takes {milliseconds:.0f} ms of the control period of "
            f"{1e3 * servo.spec.period:.0f} ms, and {100 * _TIME:.0f} % may go on it; {_what_would(servo, most)}"
        )
    make_folder(out)
    write_text(out / "agent.c", as_c(servo, quantised(servo)))
    return _built(servo, board, out.resolve(), firmware)._replace(milliseconds=milliseconds)


def _usable(agent: AnyAgent) -> ServoAgent:
    if not isinstance(agent, ServoAgent):
        raise UnusableInput("only agents of the method servo, which settle and track, drive a board")
    if agent.spec.joints != 1:
        raise UnusableInput(f"{agent.spec.name} has {agent.spec.joints} joints; this board has time for one")
    if not agent.spec.pressure_sensors:
        raise UnusableInput(f"{agent.spec.name} has no pressure sensors, and the board's guard needs them")
    return agent


def _built(agent: ServoAgent, board: str, out: Path, firmware: Path) -> Built:
    has, weights = BOARDS[board], len(agent.policy)
    command = ["make", "-C", str(firmware), "-f", "Makefile", "-f", "alone/alone.mk", "alone", f"BOARD={board}"]
    done = subprocess.run(
        [*command, f"SERVO={out / 'agent.c'}", f"BUILD={out}"], capture_output=True, text=True, timeout=LONGEST
    )
    if done.returncode:
        over = re.search(r"overflowed by (\d+) bytes", done.stderr)
        if over is None:
            raise UnusableInput(f"the program could not be built: {done.stderr.strip()[-400:]}")
        raise UnusableInput(f"does not fit: flash is {over[1]} bytes too small; {_what_would(agent, weights)}")
    sizes = subprocess.run(["avr-size", str(out / "alone.elf")], capture_output=True, text=True, check=True).stdout
    text, data, zeros = (int(word) for word in sizes.splitlines()[1].split()[:3])
    flash, memory = text + data, data + zeros
    if flash > has.flash:
        would = _what_would(agent, weights - (flash - has.flash))
        raise UnusableInput(f"does not fit: it takes {flash} bytes of flash, and there are {has.flash}; {would}")
    if memory + has.stack > has.memory:
        would = _what_would(agent, weights - 16 * (memory + has.stack - has.memory))
        raise UnusableInput(
            f"does not fit: it takes {memory} bytes of RAM and {has.stack} of stack, of {has.memory}; {would}"
        )
    return Built(out / "alone.hex", flash, memory, weights, 0.0)


def _what_would(agent: ServoAgent, weights: int) -> str:
    """Return what to do for at most so many ``weights``."""
    inputs, outputs = agent.sizes[0], agent.sizes[-1]
    fitting = [h for h in range(8, 128, 4) if (inputs + 1) * h + (h + 1) * h + (h + 1) * outputs < weights]
    if not fitting:
        return "a lower control rate, a shorter history or fewer previews would help"
    return f"an agent with smaller layers would: pneumarm train ... --servo.hidden {fitting[-1]},{fitting[-1]}"
