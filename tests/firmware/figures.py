"""The figures of the firmware that people rely on: tests hold them to their limits, a benchmark prints them."""

import os
import random
import select
import sys
import tty
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from time import perf_counter, process_time, sleep
from typing import NamedTuple

from pneumarm.arm.virtual import VirtualArm, draw_parameters
from tests.children import child
from tests.firmware import wire
from tests.firmware.board import SimulatedBoard, single_conversions
from tests.firmware.chip import FREQUENCY, Change, Chip
from tests.firmware.host import LIMIT, SESSION, Host
from tests.firmware.wire import CONSTANT

ANALOG = 8
"""Analog channels."""
_CONVERSION = 13 * 32
"""Cycles of a conversion."""


@contextmanager
def armed(**configuration: int) -> Iterator[Host]:
    """Give a host with an armed board, all valves closed, nothing at its inputs."""
    with Chip() as chip:
        yield Host(chip).ready(**configuration)


def noise(chip: Chip, rng: random.Random, seconds: float, amplitude: int = 5) -> None:
    """Let time pass [s] with another noise at each input in every conversion or so: medians have work."""
    for _ in range(round(seconds / 0.25e-3)):
        for channel in range(ANALOG):
            chip.set_count(channel, 500 + rng.randint(-amplitude, amplitude))
        chip.run(0.25e-3)


class RoundTrip(NamedTuple):
    """Times since the request's first bit began [ms]."""

    valves: list[float]
    """Until the last pin had its level."""
    reply: list[float]
    """Until the reply's last bit had come."""


def round_trip(exchanges: int = 200, conversions: int = 9, seed: int = 0) -> RoundTrip:
    """Measure exchanges that change all muscles' valves, at random moments, with noise at all inputs."""
    rng = random.Random(seed)
    times = RoundTrip([], [])
    with armed(conversions=conversions) as host:
        for i in range(exchanges):
            noise(host.chip, rng, 2.5e-3)
            host.chip.run_until(host.chip.cycle + rng.randrange(16_000))
            host.exchange(*["IN" if i % 2 else "OUT"] * CONSTANT["MUSCLES"])
            times.valves.append(host.since_begun(host.chip.changes[-1].cycle))
            times.reply.append(host.since_begun(host.ended))
    return times


def _next_change(host: Host, wait: float) -> int:
    """Wait [s]; return the cycle at which the first pin of a valve changed meanwhile."""
    chip = host.chip
    before, known = chip.valve_pins, len(chip.changes)
    chip.run(wait)
    return next(change.cycle for change in chip.changes[known:] if change.pins & 0xFF != before)


def dead_man(repeats: int = 20, seed: int = 0) -> list[float]:
    """Measure the time [ms] from the last bit of an EXCHANGE, the host's last, until the first valve vents."""
    rng = random.Random(seed)
    times = []
    with armed() as host:
        for _ in range(repeats):
            assert host.arm().has("ARMED")
            host.chip.run_until(host.chip.cycle + rng.randrange(32_000))
            host.exchange("IN", "IN", "IN", "IN")
            fed = host.begun + len(wire.request("EXCHANGE", 1, 0)) * wire.CYCLES_PER_BYTE
            times.append(1e3 * (_next_change(host, 0.26) - fed) / FREQUENCY)
            assert host.chip.valve_pins == 0
    return times


class Pulses(NamedTuple):
    """What became of pulses [ms]."""

    longer: list[float]
    """By how much the valve was open longer than asked for; less than 0 where shorter."""
    valves: list[float]
    """From the request's first bit until the last valve opened."""
    reply: list[float]
    """From the request's first bit until the reply's last bit had come."""


def pulses(commands: int = 60, seed: int = 0) -> Pulses:
    """Measure pulses of 1 to 30 ms of one to all muscles, at random moments, with noise at all inputs."""
    rng = random.Random(seed)
    found = Pulses([], [], [])
    muscles = range(CONSTANT["MUSCLES"])
    with armed(conversions=9) as host:
        chip = host.chip
        for _ in range(commands):
            chip.run_until(chip.cycle + rng.randrange(16_000))
            asked = [(rng.choice(("IN", "OUT", "CLOSED")), rng.randint(125, 3750)) for _ in muscles]
            if all(code == "CLOSED" for code, _ in asked):
                continue
            known = len(chip.changes)
            host.pulse(*asked)
            found.reply.append(host.since_begun(host.ended))
            noise(chip, rng, 0.032)
            opened = []
            for muscle, (code, length) in enumerate(asked):
                if code == "CLOSED":
                    continue
                begin, end = open_between(chip.changes[known - 1 :], muscle, code)
                opened.append(host.since_begun(begin))
                found.longer.append(1e3 * (end - begin) / FREQUENCY - 1e-3 * CONSTANT["PULSE_UNIT_US"] * length)
            found.valves.append(max(opened))
    return found


def open_between(changes: Sequence[Change], muscle: int, code: str) -> tuple[int, int]:
    """Return the cycles at which a muscle's valves took on ``code`` and closed again, once and no more."""
    levels = {"IN": 0b11, "OUT": 0b00, "CLOSED": 0b10}
    steps = [(change.cycle, change.pins >> 2 * muscle & 3) for change in changes]
    steps = [now for before, now in pairwise(steps) if now[1] != before[1]]
    assert [level for _, level in steps] == [levels[code], levels["CLOSED"]], steps
    return steps[0][0], steps[1][0]


class OverPressure(NamedTuple):
    """Times until the muscle's inlet closes [ms]."""

    since_third_sample: list[float]
    since_onset: list[float]


def over_pressure(repeats: int = 40, seed: int = 0) -> OverPressure:
    """Measure how long a muscle over its limit is inflated, the muscles in turn, at random moments."""
    rng = random.Random(seed)
    times = OverPressure([], [])
    channels = [1, 2, 4, 5]
    with armed() as host:
        chip = host.chip
        chip.log_samples()
        for i in range(repeats):
            channel = channels[i % len(channels)]
            assert host.arm().has("ARMED")
            host.exchange("IN", "IN", "IN", "IN")
            chip.run_until(chip.cycle + rng.randrange(32_000))
            chip.samples.clear()
            onset = chip.cycle
            chip.set_count(channel, LIMIT + 1)
            cut = _next_change(host, 5e-3)
            begun = [cycle for cycle, converted in chip.samples if converted == channel and cycle >= onset]
            third = begun[CONSTANT["OVER_PRESSURE_SAMPLES"] - 1] + _CONVERSION
            times.since_third_sample.append(1e3 * (cut - third) / FREQUENCY)
            times.since_onset.append(1e3 * (cut - onset) / FREQUENCY)
            chip.set_count(channel, 0)
            chip.run(2e-3)
    return times


def watchdog(repeats: int = 5, *, interrupts: bool = True, seed: int = 0) -> list[float]:
    """Measure the time [ms] from a hang of the main loop until all outputs are off."""
    rng = random.Random(seed)
    times = []
    for _ in range(repeats):
        with armed() as host:
            host.exchange("IN", "IN", "IN", "IN")
            host.chip.run_until(host.chip.cycle + rng.randrange(32_000))
            begin = host.chip.cycle
            host.chip.hang(interrupts=interrupts)
            host.chip.run(0.2)
            off = next(
                change.cycle for change in host.chip.changes if change.cycle > begin and change.pins & 0xFF == 0
            )
            times.append(1e3 * (off - begin) / FREQUENCY)
    return times


def speed(seconds: float = 2.0, seed: int = 1) -> float:
    """Return how many times real time the board runs with a virtual arm on a core, 30 exchanges a second."""
    board = SimulatedBoard(single_conversions(VirtualArm(draw_parameters(seed))))
    with board:
        board.wait(0.05)  # compiles the physics
        host = Host(board.chip).ready()
        begin = process_time()
        first = board.time
        for turn in range(round(30 * seconds)):
            board.write(wire.request("EXCHANGE", host.sequence + 1 + turn, wire.valves("IN" if turn & 8 else "OUT")))
            board.wait(1 / 30)
        return (board.time - first) / (process_time() - begin)


@contextmanager
def pseudo_terminal(arm: str = "virtual:seed=1") -> Iterator[str]:
    """Give the path of a line to a board with an arm, in a process of its own and in real time."""
    root = Path(__file__).parents[2]
    environment = {**os.environ, "PYTHONPATH": f"{root / 'src'}{os.pathsep}{root}"}
    command = [sys.executable, "-m", "tests.firmware.pty_board", "--arm", arm]
    with child(*command, cwd=root, env=environment, stderr=None) as process:
        assert process.stdout is not None
        yield process.stdout.readline().strip()


class Port:
    """A serial line, opened as an operating system gives it."""

    def __init__(self, path: str) -> None:
        self._line = os.open(path, os.O_RDWR | os.O_NOCTTY)
        tty.setraw(self._line)

    def ask(self, name: str, sequence: int, *values: int, timeout: float = 2.0) -> wire.Reply:
        """Send a request and return its reply."""
        os.write(self._line, wire.request(name, sequence, *values))
        frame = b""
        while not frame.endswith(b"\0"):
            if not select.select([self._line], [], [], timeout)[0]:
                raise TimeoutError(f"no reply to {name}")
            frame = (frame + os.read(self._line, 64)).lstrip(b"\0")  # zeros between frames mean nothing
        return wire.reply(frame[:-1])

    def close(self) -> None:
        """Close the line."""
        os.close(self._line)


def round_trip_in_real_time(exchanges: int = 300, period: float = 0.01) -> list[float]:
    """Measure round trips [ms] over a pseudo-terminal, the operating system and the simulator's own pace included."""
    with pseudo_terminal() as path:
        port = Port(path)
        port.ask("CONNECT", 1, CONSTANT["VERSION"], SESSION)
        port.ask("CONFIGURE", 2, 5, 16, *[LIMIT] * CONSTANT["MUSCLES"])
        port.ask("ARM", 3, SESSION)
        times = []
        for turn in range(exchanges):
            begin = perf_counter()
            port.ask("EXCHANGE", 4 + turn, wire.valves("IN" if turn & 8 else "OUT"))
            times.append(1e3 * (perf_counter() - begin))
            sleep(max(0.0, period - (perf_counter() - begin)))
        port.close()
    return times
