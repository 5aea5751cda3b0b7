"""The real firmware in a simulated microcontroller: how fast it answers, and how fast it vents.

python -m benchmarks firmware
"""

from collections.abc import Iterator
from statistics import median, quantiles

from tests.firmware import figures
from tests.firmware.build import missing


def measure() -> Iterator[str]:
    """Yield the figures, each with what it must keep."""
    if lacks := missing():
        yield f"left out: {lacks}"
        return
    times = figures.round_trip()
    yield (
        f"from the request's first bit to the last valve pin: {median(times.valves):.3f} ms, "
        f"at most {max(times.valves):.3f} (limit 0.5); to the reply's last bit: {median(times.reply):.3f} ms, "
        f"at most {max(times.reply):.3f} (limit 1.5); medians of 9, noise at all inputs, {len(times.reply)} exchanges"
    )
    pulses = figures.pulses()
    yield (
        f"{len(pulses.longer)} pulses: {1e3 * min(pulses.longer):+.0f} to {1e3 * max(pulses.longer):+.0f} us longer "
        f"than asked for (limit 50); from the request's first bit to the last valve pin at most "
        f"{max(pulses.valves):.3f} ms (limit 0.75), to the reply's last bit {max(pulses.reply):.3f} (limit 1.75)"
    )
    dead = figures.dead_man()
    yield f"dead-man: {min(dead):.2f} to {max(dead):.2f} ms after the last exchange (limit 251)"
    over = figures.over_pressure()
    yield (
        f"over-pressure: cut at most {max(over.since_third_sample):.3f} ms after the third sample (limit 2), "
        f"{max(over.since_onset):.2f} ms after its onset"
    )
    for interrupts, what in ((True, "interrupts on"), (False, "interrupts off")):
        hung = figures.watchdog(interrupts=interrupts)
        yield f"hung program, {what}: outputs off after {min(hung):.1f} to {max(hung):.1f} ms (limit 150)"
    real = figures.round_trip_in_real_time()
    yield f"over a pseudo-terminal in real time: {median(real):.2f} ms, {quantiles(real, n=100)[-1]:.2f} ms at p99"
    yield f"with a virtual arm in lock-step: {figures.speed():.1f} times real time on a core (limit 1)"
