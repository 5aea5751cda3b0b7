"""The default agent: seconds of fitting and training, and how long its decisions take while it moves an arm.

python -m benchmarks policy

A development arm, the default settings throughout; kernels are compiled before anything is timed. Decisions are timed
from the reading to the valves, looking ahead where that is not clear; processor time is what a decision costs, the
time on the clock is that and whatever else the machine does.
"""

import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks._trials import collected, fitted, greedy_movements
from pneumarm.arm import Reading
from pneumarm.control import AgentController
from pneumarm.learning import AnyAgent, PolicySettings, train

ARM = 1
SEED = 0
TRANSITIONS = 200_000
MOVEMENTS = 300
LIMIT = 2.0
"""What a decision may take at the 99th percentile [ms]: little of a control period of 33 ms."""


class Timed(AgentController):
    """A controller that notes how long its decisions take: on the processor and on the clock [s]."""

    def __init__(self, agent: AnyAgent) -> None:
        super().__init__(agent)
        self.seconds: list[tuple[float, float]] = []

    def act(self, reading: Reading) -> NDArray[np.int8]:
        began, worked = time.perf_counter(), time.thread_time()
        valves = super().act(reading)
        self.seconds.append((time.thread_time() - worked, time.perf_counter() - began))
        return valves


def measure() -> Iterator[str]:
    with tempfile.TemporaryDirectory() as folder:
        db = Path(folder) / "arm.db"
        began = time.perf_counter()
        transitions, minutes = collected(db, ARM, SEED, TRANSITIONS)
        seconds = time.perf_counter() - began
        yield f"collecting {transitions:,} transitions, {minutes:.0f} min on the arm's clock: {seconds:.1f} s"
        fitted(db, SEED)  # compiles, or loads what was compiled
        worked = time.process_time()
        made, begin = fitted(db, SEED)
        worked = time.process_time() - worked
    result = made.result
    yield f"fit of {result.rows:,} rows: {result.seconds:.2f} s; with filtering and errors {worked:.2f} s of a core"
    trained = train(made.simulation, begin, PolicySettings(), SEED)
    speed = trained.steps.sum() / trained.core_seconds / 1e6
    yield (
        f"training of {len(trained.validation)} policies: {trained.seconds:.2f} s with validation, "
        f"{trained.core_seconds:.2f} s of cores, {speed:.2f} M steps/s a core"
    )
    controller = Timed(trained.agent)
    greedy_movements(trained.agent, ARM, made.simulation.goal_range, range(1), SEED, controller)
    controller.seconds.clear()
    on_arm = greedy_movements(trained.agent, ARM, made.simulation.goal_range, range(MOVEMENTS), SEED, controller)
    yield (
        f"{MOVEMENTS} movements on the arm: reward {np.mean([one.reward for one in on_arm]):.2f}, "
        f"{sum(one.success for one in on_arm)} reached their goals"
    )
    for name, times in zip(("processor", "clock"), 1e3 * np.array(controller.seconds).T, strict=True):
        half, most = np.quantile(times, (0.5, 0.99))
        verdict = f"{'within' if most < LIMIT else 'OVER'} the {LIMIT:g} ms allowed"
        yield f"decisions, {name} time: median {half:.3f} ms, 99 % within {most:.2f} ms, {verdict}"
