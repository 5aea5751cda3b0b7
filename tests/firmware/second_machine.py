"""The firmware in avr8js, an AVR simulator by other people: what both machines do is no simulator's fancy."""

import functools
import json
import shutil
import subprocess
from pathlib import Path
from typing import Any, Self

from tests.firmware.build import HERE, hex_file
from tests.firmware.build import missing as firmware_missing
from tests.firmware.chip import FREQUENCY, VALVE_PINS, Change
from tests.firmware.wire import CAUSE

FOLDER = HERE / "avr8js"


@functools.cache
def missing() -> str:
    """Return what the second machine lacks here; empty where it runs."""
    if lacks := firmware_missing():
        return lacks
    if shutil.which("node") is None:
        return "node missing"
    if not (FOLDER / "node_modules" / "avr8js").is_dir():
        return f"avr8js missing; npm ci --prefix {FOLDER.relative_to(HERE.parents[1])}"
    return ""


class SecondChip:
    """What :class:`tests.firmware.chip.Chip` is, in a process of its own. A context manager.

    It has no buffer for bytes that come while the processor is busy, where a real line has one of two: what sends
    must not hear at the same time, as a host does that has one request under way.
    """

    def __init__(self, firmware: Path | None = None) -> None:
        command = ["node", str(FOLDER / "machine.js"), str(firmware or hex_file())]
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        self.changes = [Change(0, 0)]
        """Levels of the pins as they changed."""
        self.resets: list[int] = []
        """Cycles of resets."""
        self.cycle = 0
        """Cycles since power-on."""
        self._sent: list[tuple[int, int]] = []
        self._do(run=0)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._process.kill()
        self._process.communicate()

    def _do(self, **command: Any) -> None:
        process = self._process
        assert process.stdin is not None
        assert process.stdout is not None
        process.stdin.write(json.dumps(command) + "\n")
        process.stdin.flush()
        answer = process.stdout.readline()
        if not answer:
            raise RuntimeError("the second machine broke down")
        said = json.loads(answer)
        self.cycle = said["cycle"]
        for cycle, kind, value in said["events"]:
            if kind == "pins":
                self.changes.append(Change(cycle, value))
            elif kind == "sent":
                self._sent.append((cycle, value))
            else:
                self.resets.append(cycle)

    @property
    def pins(self) -> int:
        """Levels of D4 to D13, bit 0 first."""
        return self.changes[-1].pins

    @property
    def valve_pins(self) -> int:
        """Levels of D4 to D11, bit 0 first."""
        return self.pins & VALVE_PINS

    def run_until(self, cycle: int) -> None:
        """Run until ``cycle``, or an instruction later."""
        self._do(run=cycle)

    def run(self, seconds: float) -> None:
        """Run for ``seconds`` [s]."""
        self.run_until(self.cycle + round(seconds * FREQUENCY))

    def write(self, data: bytes) -> None:
        """Put bytes on the line to the board, one after the other, from now on."""
        self._do(write=list(data))

    def received(self) -> list[tuple[int, int]]:
        """Return the bytes whose last bit has left the board by now, each with the cycle of that."""
        done = [sent for sent in self._sent if sent[0] <= self.cycle]
        self._sent = [sent for sent in self._sent if sent[0] > self.cycle]
        return done

    def set_count(self, channel: int, count: int) -> None:
        """Put the voltage at an analog channel that converts to ``count``."""
        self._do(count=[channel, count])

    def reset(self, cause: str = "EXTERNAL") -> None:
        """Reset for a cause of the page."""
        self._do(reset=CAUSE[cause])

    def hang(self, *, interrupts: bool = True) -> None:
        """Let the main loop hang, with or without interrupts."""
        self._do(hang=interrupts)
