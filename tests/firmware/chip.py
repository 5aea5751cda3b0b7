"""The microcontroller in simavr: cycles, bytes on its line, counts at its converter, levels at its pins."""

import ctypes
from collections import deque
from pathlib import Path
from typing import NamedTuple, Self

from tests.firmware.build import hex_file, shim, symbols
from tests.firmware.wire import CAUSE

FREQUENCY = 16_000_000
"""Cycles a second."""
HIGHEST_COUNT = 1023
SUPPLY = 5000
"""Voltage of the converter's reference [mV]."""
LIGHT = 1 << 9
"""The light among the levels of D4 to D13."""
VALVE_PINS = 0xFF
_MOST = 4096


class _Event(ctypes.Structure):
    _fields_ = (("cycle", ctypes.c_uint64), ("kind", ctypes.c_uint32), ("value", ctypes.c_uint32))


_PINS, _SENT, _SAMPLE, _RESET = range(4)


class Change(NamedTuple):
    """Levels of D4 to D13, bit 0 first, from a cycle on."""

    cycle: int
    pins: int


def _load(library: Path) -> ctypes.CDLL:
    shim = ctypes.CDLL(str(library))
    board, u8, u16, u32, u64 = ctypes.c_void_p, ctypes.c_uint8, ctypes.c_uint16, ctypes.c_uint32, ctypes.c_uint64
    signatures = {
        "board_new": (board, [ctypes.c_char_p]),
        "board_free": (None, [board]),
        "board_run": (ctypes.c_int, [board, u64]),
        "board_cycle": (u64, [board]),
        "board_write": (None, [board, ctypes.c_char_p, u32]),
        "board_events": (u32, [board, ctypes.POINTER(_Event), u32]),
        "board_millivolts": (None, [board, u32, u32]),
        "board_log_samples": (None, [board, ctypes.c_int]),
        "board_reset": (None, [board, u32]),
        "board_watch": (None, [board]),
        "board_longest_masked": (u64, [board]),
        "board_peek": (u8, [board, u16]),
        "board_poke": (None, [board, u16, u8]),
        "board_jump": (None, [board, u32]),
        "board_word": (u16, [board, u32]),
    }
    for name, (result, arguments) in signatures.items():
        function = getattr(shim, name)
        function.restype, function.argtypes = result, arguments
    return shim


class Chip:
    """An ATmega328P at 16 MHz with the firmware in it, from power-on. A context manager.

    Args:
        firmware: the .hex; built where it is not given.

    """

    def __init__(self, firmware: Path | None = None) -> None:
        self._shim = _load(shim())
        self._board = self._shim.board_new(str(firmware or hex_file()).encode())
        if not self._board:
            raise RuntimeError(f"simavr does not load {firmware}")
        self._events = (_Event * _MOST)()
        self._sent: deque[tuple[int, int]] = deque()
        self.changes = [Change(0, 0)]
        """Levels of the pins as they changed."""
        self.samples: list[tuple[int, int]] = []
        """Cycle and channel of the conversions begun, while :meth:`log_samples` is on."""
        self.resets: list[int] = []
        """Cycles of resets."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Free the simulator's memory."""
        if self._board:
            self._shim.board_free(self._board)
            self._board = None

    @property
    def cycle(self) -> int:
        """Cycles since power-on."""
        return int(self._shim.board_cycle(self._board))

    @property
    def time(self) -> float:
        """Time since power-on [s]."""
        return self.cycle / FREQUENCY

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
        if not self._shim.board_run(self._board, cycle):
            raise RuntimeError("the simulated processor crashed")
        self._collect()

    def run(self, seconds: float) -> None:
        """Run for ``seconds`` [s]."""
        self.run_until(self.cycle + round(seconds * FREQUENCY))

    def _collect(self) -> None:
        while count := self._shim.board_events(self._board, self._events, _MOST):
            for event in self._events[:count]:
                if event.kind == _SENT:
                    self._sent.append((event.cycle, event.value))
                elif event.kind == _PINS:
                    self.changes.append(Change(event.cycle, event.value))
                elif event.kind == _SAMPLE:
                    self.samples.append((event.cycle, event.value))
                elif event.kind == _RESET:
                    self.resets.append(event.cycle)

    def write(self, data: bytes) -> None:
        """Put bytes on the line to the board, one after the other, from now on."""
        self._shim.board_write(self._board, data, len(data))

    def received(self) -> list[tuple[int, int]]:
        """Return the bytes whose last bit has left the board by now, each with the cycle of that."""
        now, done = self.cycle, []
        while self._sent and self._sent[0][0] <= now:
            done.append(self._sent.popleft())
        return done

    def set_count(self, channel: int, count: int) -> None:
        """Put the voltage at an analog channel that converts to ``count``."""
        if not 0 <= count <= HIGHEST_COUNT:
            raise ValueError(f"a count is 0 to {HIGHEST_COUNT}, got {count}")
        self._shim.board_millivolts(self._board, channel, -(-count * SUPPLY // HIGHEST_COUNT))

    def log_samples(self, on: bool = True) -> None:
        """Keep the times of conversions."""
        self._shim.board_log_samples(self._board, on)

    def reset(self, cause: str = "EXTERNAL") -> None:
        """Reset for a cause of the page; EXTERNAL is the reset pin, which opening the port of an Uno pulls."""
        self._shim.board_reset(self._board, CAUSE[cause])
        self._collect()

    def watch_interrupts(self) -> None:
        """Measure from now on for how long interrupts are off; the simulation is slower from then on."""
        self._shim.board_watch(self._board)

    @property
    def longest_masked(self) -> float:
        """Longest time that interrupts were off since :meth:`watch_interrupts` [s]."""
        return int(self._shim.board_longest_masked(self._board)) / FREQUENCY

    def peek(self, address: int) -> int:
        """Return a byte of the data memory."""
        return int(self._shim.board_peek(self._board, address))

    def poke(self, address: int, value: int) -> None:
        """Write a byte of the data memory behind the program's back."""
        self._shim.board_poke(self._board, address, value)

    def variable(self, name: str) -> int:
        """Return the value of a variable of the program."""
        address, size = symbols()[name]
        return int.from_bytes(bytes(self.peek(address + i) for i in range(size)), "little")

    def set_variable(self, name: str, value: int) -> None:
        """Write a variable of the program behind its back."""
        address, size = symbols()[name]
        for i, byte in enumerate(value.to_bytes(size, "little")):
            self.poke(address + i, byte)

    def hang(self, *, interrupts: bool = True) -> None:
        """Let the main loop hang, as after a disturbance: with or without interrupts.

        Every program has its endless loop after ``main`` in it; this jumps there.
        """
        endless, cli = 0xCFFF, 0x94F8
        for address in range(2, 0x8000, 2):
            words = [self._shim.board_word(self._board, at) for at in (address - 2, address)]
            if words == [cli, endless]:
                self._shim.board_jump(self._board, address if interrupts else address - 2)
                return
        raise RuntimeError("the program has no endless loop")
