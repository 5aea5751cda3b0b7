"""The store and the filter: rows a second, and the memory that a filtered store takes.

python -m benchmarks store                                   a million transitions
PNEUMARM_BENCHMARK_TRANSITIONS=10000000 python -m benchmarks store
"""

import resource
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from benchmarks import _environment as environment
from pneumarm.arm import ArmSpec
from pneumarm.simulation import FitSettings, fit_store
from pneumarm.transitions import Recorded, Store, Window, filter_transitions

ACTIONS = 200
EPOCHS = 15


def measure() -> Iterator[str]:
    """Yield lines of figures on synthetic rows in a temporary store."""
    wanted = environment.whole("PNEUMARM_BENCHMARK_TRANSITIONS", 1_000_000)
    for joints in (1, 2):
        count = wanted // ACTIONS if joints == 1 else wanted // (10 * ACTIONS)
        with tempfile.TemporaryDirectory() as folder:
            yield from _measure(Path(folder) / "store.db", joints, count)


def _measure(path: Path, joints: int, count: int) -> Iterator[str]:
    yield f"{joints} joint(s), {count * ACTIONS:,} transitions"
    with Store.create(path, ArmSpec(joints=joints)) as store:
        random = np.random.default_rng(0)
        durable = min(count, 200)
        begun = time.perf_counter()
        for _ in range(durable):
            store.append(_sequence(random, joints))
        seconds = time.perf_counter() - begun
        yield f"  sequences made durable one by one {durable / seconds:12,.0f} /s"
        begun = time.perf_counter()
        for first in range(durable, count, 1000):
            store.append_all(_sequence(random, joints) for _ in range(first, min(first + 1000, count)))
        seconds = time.perf_counter() - begun
        if count > durable:
            rows = (count - durable) * (ACTIONS + 1)
            yield f"  rows made and written in bulk     {rows / seconds:12,.0f} /s"
    with Store.open(path) as store:
        begun = time.perf_counter()
        rows = sum(len(block) for block in store)
        reading = time.perf_counter() - begun
        yield f"  rows read and checked             {rows / reading:12,.0f} /s"
        begun = time.perf_counter()
        filtered = filter_transitions(store, Window(joints), hold_out=0.1)
        seconds = time.perf_counter() - begun
        coverage = filtered.coverage
        rate, readings = coverage.seen / seconds, seconds / reading
        yield f"  transitions filtered              {rate:12,.0f} /s, in {readings:.1f} times a reading"
        yield f"  kept {coverage.kept:,} of {coverage.seen:,} in {coverage.occupied:,} of {coverage.cells:,} cells"
        begun = time.perf_counter()
        apart = filtered.sample("generalisation")
        seconds = time.perf_counter() - begun
        count = 0 if apart is None else len(apart.sequence)
        yield f"  {count:,} of those left out drawn in {seconds:.1f} s"
        if joints == 1:
            begun = time.perf_counter()
            fitted = fit_store(store, FitSettings(epochs=EPOCHS))
            seconds = time.perf_counter() - begun
            yield f"  filtered and fitted ({fitted.result.rows:,} kept) {seconds:14.1f} s, a fit of {EPOCHS} epochs"
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    yield f"  most memory of the process so far {peak:12,.0f} MiB"


def _sequence(random: np.random.Generator, joints: int) -> Recorded:
    """Return a sequence of a caricature of an arm: pressures drift with the valves, the angle follows them."""
    n = ACTIONS + 1
    command = random.integers(-1, 2, (n, joints, 2)).astype(float)
    drift = 85 + np.cumsum(8 * command, axis=0)
    pressure = np.abs((drift + random.integers(0, 160, (1, joints, 2))) % 320 - 160)
    angle = np.rint(512 + 2.5 * (pressure[:, :, 0] - pressure[:, :, 1]) + random.normal(0, 3, (n, joints)))
    command[-1] = np.nan
    time_ = np.cumsum(random.normal(1 / 30, 0.0005, n))
    return Recorded(time_, angle, pressure, command, np.arange(n), "velocity", at_rest=True)
