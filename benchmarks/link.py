"""The serial link on bad lines: how well the loop keeps its rate, in lock-step on the emulated board.

The limits: no stale request ever acts, and a loop at 30 Hz misses no more deadlines than 1 % with a fifth of all
frames lost, doubled or late in both directions.
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
    head = f"{'rate':>6} {'fault':>8} {'share':>6} {'missed':>7} {'retries':>8} {'late turn p99':>14}"
    yield f"{head} {'stale':>6} applied"
    for rate in RATES:
        yield row(rate, "none", LineFaults())
        for share in SHARES:
            for kind in KINDS:
                yield row(rate, kind, replace(LineFaults(), **{kind: share}))
            yield row(rate, "all", LineFaults(dropped=share, doubled=share, late=share))


def row(rate: float, name: str, faults: LineFaults) -> str:
    """Return a row of the table: one line with these faults."""
    w = wired(period=1 / rate)
    w.line.faults = faults
    rng, cycle, times = np.random.default_rng(0), ControlCycle(guarded(w.arm)), []
    shape = (w.arm.spec.joints, 2)
    end = ""
    try:
        for step in cycle.run(lambda _: rng.integers(-1, 2, shape).astype(np.int8) if len(times) < TURNS else None):
            times.append(step.reading.time)
    except ArmFailure as error:
        end = f"  given up after {len(times)} turns: {error}"
    late = np.quantile(np.diff(times), 0.99) - 1 / rate if len(times) > 1 else np.nan
    share = max(getattr(faults, kind) for kind in KINDS)
    missed, retries = cycle.missed_deadlines / len(times), w.arm.link.counts.retries / w.arm.link.counts.requests
    return (
        f"{rate:3d} Hz {name:>8} {share:6.0%} {missed:7.1%} {retries:8.2f} {1e3 * late:11.1f} ms {w.wire.stale:6d} "
        f"{w.wire.stale_applied:7d}{end}"
    )
