"""The serial link on bad lines: how well the loop keeps its rate, in lock-step on the emulated board.

The limits: no stale request ever acts, the ticks of the loop stay on the grid of its first one, and a loop at 30 Hz
misses no more of them than 1 % with a fifth of all frames lost, doubled or late in both directions.

ticks: points of the grid that passed, a second; missed: share of those without a turn within half a period; drift:
how much later the promptest tenth of the turns in time are in the second half than in the first; late: how long
after its point of the grid a turn in time is read.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from tests.arm.serial.wired import wired

from pneumarm.arm import ControlCycle, guarded
from pneumarm.arm.serial import LineFaults
from pneumarm.errors import ArmFailure

SHARES = (0.05, 0.2, 0.5)
KINDS = ("dropped", "doubled", "late")
TURNS = 2_000
RATES = (30, 100)


def measure() -> Iterator[str]:
    """Run the control cycle with random valves on the virtual arm behind the board."""
    yield f"{TURNS:,} control periods, 0.5 ms each way, late ones 50 ms; shares of the frames in each direction"
    head = f"{'rate':>6} {'fault':>8} {'share':>6} {'ticks':>9} {'missed':>7} {'drift':>8} {'retries':>8}"
    yield f"{head} {'late p99':>9} {'stale':>6} applied"
    for rate in RATES:
        yield row(rate, "none", LineFaults())
        for share in SHARES:
            for kind in KINDS:
                yield row(rate, kind, replace(LineFaults(), **{kind: share}))
            yield row(rate, "all", LineFaults(dropped=share, doubled=share, late=share))


def row(rate: float, name: str, faults: LineFaults) -> str:
    """Return a row of the table: one line with these faults."""
    w = wired(period=1 / rate)
    w.arm.spec = replace(w.arm.spec, latency=0.0)  # hardware takes its time by itself
    w.line.faults = faults
    rng, cycle, times = np.random.default_rng(0), ControlCycle(guarded(w.arm)), []
    shape = (w.arm.spec.joints, 2)
    end = ""
    try:
        for step in cycle.run(lambda _: rng.integers(-1, 2, shape).astype(np.int8) if len(times) < TURNS else None):
            times.append(step.reading.time)
    except ArmFailure as error:
        end = f"  given up after {len(times)} turns: {error}"
    at = np.array(times) - times[0]
    off = at - np.rint(at * rate) / rate
    off = off[off > -1e-6]  # who is before a point of the grid missed the one before
    ticks = cycle.missed_deadlines + len(times)
    share = max(getattr(faults, kind) for kind in KINDS)
    missed, retries = cycle.missed_deadlines / ticks, w.arm.link.counts.retries / w.arm.link.counts.requests
    early, later = (np.quantile(half, 0.1) for half in np.array_split(off, 2))
    kept, drift, late = (ticks - 1) / at[-1], later - early, np.quantile(off, 0.99)
    return (
        f"{rate:3d} Hz {name:>8} {share:6.0%} {kept:7.2f}/s {missed:7.1%} {1e3 * drift:5.2f} ms {retries:8.2f} "
        f"{1e3 * late:6.1f} ms {w.wire.stale:6d} {w.wire.stale_applied:7d}{end}"
    )
