"""What the real .hex measures: medians, velocities, times."""

import random
import re
import statistics
import subprocess
from itertools import pairwise

import pytest

from tests.firmware import wire
from tests.firmware.build import elf_file, missing
from tests.firmware.chip import Chip
from tests.firmware.figures import ANALOG, armed
from tests.firmware.host import Host
from tests.firmware.wire import CONSTANT

pytestmark = pytest.mark.skipif(bool(missing()), reason=missing())
ANGLES, PRESSURES, EXTRAS = [0, 3], [1, 2, 4, 5], [6, 7]
SCALE = CONSTANT["VELOCITY_SCALE"]


def values(reading: wire.Reply) -> list[int]:
    """Return the eight values of a reading in the order of the analog channels."""
    found = dict(zip(ANGLES, reading.angle, strict=True))
    found.update(zip(PRESSURES, reading.pressure, strict=True))
    found.update(zip(EXTRAS, reading.extra, strict=True))
    return [found[channel] for channel in range(ANALOG)]


@pytest.mark.parametrize("conversions", [5, 7, 9])
def test_every_count_of_every_channel(conversions: int) -> None:
    rng = random.Random(conversions)
    with armed(conversions=conversions, limit=1023) as host:
        for counts in (
            [0] * ANALOG,
            [1023] * ANALOG,
            *([rng.randrange(1024) for _ in range(ANALOG)] for _ in range(40)),
        ):
            for channel, count in enumerate(counts):
                host.chip.set_count(channel, count)
            host.chip.run(0.003)
            assert values(host.ask("READ")) == counts


@pytest.mark.parametrize("conversions", [5, 7, 9])
def test_each_value_is_the_median_of_the_last_conversions(conversions: int) -> None:
    """Each conversion of each channel is given a value of its own and noted; a reading is the median of the last."""
    rng = random.Random(conversions)
    given = [[0] * conversions for _ in range(ANALOG)]
    counts = [0] * ANALOG
    with armed(conversions=conversions, limit=1023) as host:
        chip = host.chip
        chip.log_samples()
        for _ in range(60):
            chip.samples.clear()
            noted = 0
            for _ in range(2 * conversions * ANALOG):
                for channel in range(ANALOG):
                    counts[channel] = rng.choice((rng.randrange(1024), 500, 501, 502))
                    chip.set_count(channel, counts[channel])
                chip.run_until(chip.cycle + 400)  # less than a conversion
                for _, channel in chip.samples[noted:]:
                    given[channel].append(counts[channel])
                noted = len(chip.samples)
            found = values(host.ask("READ"))  # and meanwhile the inputs stay
            for channel in range(ANALOG):
                possible = {
                    statistics.median((given[channel] + [counts[channel]] * since)[-conversions:])
                    for since in range(3)
                }
                assert found[channel] in possible
                given[channel] += [counts[channel]] * sum(c == channel for _, c in chip.samples[noted:])


@pytest.mark.parametrize("conversions", [5, 7, 9])
def test_a_disturbance_of_less_than_half_the_conversions_is_not_seen(conversions: int) -> None:
    with armed(conversions=conversions, limit=1023) as host:
        chip = host.chip
        chip.log_samples()
        for disturbed in range(1, conversions):
            chip.set_count(0, 200)
            chip.run(0.005)
            chip.samples.clear()
            chip.set_count(0, 900)
            while sum(channel == 0 for _, channel in chip.samples) < disturbed:
                chip.run_until(chip.cycle + 50)
            chip.set_count(0, 200)
            reply = host.ask("READ")  # which is there after one sweep, at most two
            assert reply.angle[0] == (900 if disturbed > conversions // 2 else 200)


def ramp(host: Host, per_ms: float, seconds: float, start: float) -> wire.Reply:
    """Move the first angle by so many counts a millisecond; return a reading at its end."""
    chip = host.chip
    steps = round(seconds / 0.1e-3)
    for step in range(steps):
        chip.set_count(0, round(start + per_ms * 0.1 * step))
        chip.run(0.1e-3)
    chip.write(wire.request("READ", host.sequence + 1))
    host.sequence += 1
    replies: list[wire.Reply] = []
    while not replies:
        steps += 1
        chip.set_count(0, round(start + per_ms * 0.1 * steps))
        replies = host.send(b"", wait=0.1e-3)
    return replies[0]


@pytest.mark.parametrize("conversions", [5, 9])
@pytest.mark.parametrize("velocity_ms", [1, 8, CONSTANT["MOST_VELOCITY_MS"]])
@pytest.mark.parametrize("per_ms", [-6.0, -0.5, 0.0, 0.25, 2.0, 10.0])
def test_velocity_of_a_ramp(conversions: int, velocity_ms: int, per_ms: float) -> None:
    with armed(conversions=conversions, velocity_ms=velocity_ms, limit=1023) as host:
        reply = ramp(host, per_ms, 0.045, start=512 - per_ms * 25)
        # Each end is off by a rounding and by the moment of its conversion, a fraction of a sweep.
        tolerance = (1.01 + 0.3 * abs(per_ms)) / velocity_ms
        assert abs(reply.velocity[0] / SCALE - per_ms) <= tolerance
        assert reply.velocity[1] == 0


@pytest.mark.parametrize("direction", [1, -1])
def test_velocity_of_a_leap_does_not_wrap(direction: int) -> None:
    ends = (0, 1023)[::direction]
    with armed(velocity_ms=1, limit=1023) as host:
        seen = set()
        for i in range(12):
            host.chip.set_count(0, ends[0])
            host.chip.run(0.01)
            host.chip.set_count(0, ends[1])
            host.chip.run(i * 0.2e-3)
            seen.add(host.ask("READ").velocity[0])
        assert seen == {0, direction * 32767}


def test_after_configure_the_arm_is_at_rest() -> None:
    with Chip() as chip:
        chip.set_count(0, 700)
        host = Host(chip)
        host.connect()
        host.configure(velocity_ms=32)
        chip.run(0.002)
        assert host.ask("READ").velocity == (0, 0)


def test_time_is_that_of_the_crystal() -> None:
    rng = random.Random(5)
    with armed() as host:
        first = host.ask("READ")
        offset = host.begun - 16 * first.time
        for _ in range(200):
            host.chip.run_until(host.chip.cycle + rng.randrange(40_000))
            reading = host.exchange("IN")
            # Sampled after the request came and before its reply began.
            assert abs(host.begun - 16 * reading.time - offset) < 16 * 250


def test_time_never_goes_back() -> None:
    """Readings at all phases of the tick."""
    with armed() as host:
        before = -1
        for i in range(400):
            now = host.ask("READ", wait=0.0021 + i * 1e-6).time
            assert 2000 < now - before < 2700 or before < 0
            before = now


def test_time_wraps_after_32_bits() -> None:
    with armed() as host:
        symbols = subprocess.run(["avr-nm", str(elf_file())], capture_output=True, text=True, check=True).stdout
        address = re.search(r"^00800(\w+) b ticks_us", symbols, re.MULTILINE)
        assert address is not None
        for i, byte in enumerate((2**32 - 5000).to_bytes(4, "little")):
            host.chip.poke(int(address[1], 16) + i, byte)
        times = [host.exchange("IN").time for _ in range(4)]
        assert times[0] > 2**32 - 5000
        assert times[-1] < 20_000
        assert all(3000 < (b - a) % 2**32 < 5000 for a, b in pairwise(times))
