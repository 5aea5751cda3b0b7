"""What planning achieves on virtual arms, and how long it takes to decide.

python -m benchmarks bound

Goals lie in the inner part of the angle's range here; ``pneumarm bound`` draws them as a transfer does.
"""

from collections.abc import Iterator
from time import perf_counter

import numpy as np

from pneumarm.arm.virtual import VirtualArm, draw_parameters
from pneumarm.bound.reaching import BoundSettings, measure_bound

ARMS = (1, 2, 3)
EPISODES = 200
GOALS = np.array([[150.0, 870.0]])


def measure() -> Iterator[str]:
    """Yield lines with the figures of each arm, and how much faster than the arm's own time they are found."""
    few = BoundSettings(episodes=1)
    measure_bound(VirtualArm(), GOALS, few)  # compiles, or loads what was compiled
    for seed in ARMS:
        began = perf_counter()
        planned = measure_bound(VirtualArm(draw_parameters(seed)), GOALS, BoundSettings(episodes=EPISODES))
        elapsed = perf_counter() - began
        results = {planner: movements.results() for planner, movements in planned.items()}
        for planner, figures in results.items():
            low, high = figures["intervals"]["reward"]
            yield (
                f"arm {seed}, {planner.replace('_', ' ')}: reward {figures['reward']:.2f} ({low:.2f} to {high:.2f}), "
                f"success {figures['success_rate']:.3f}, {figures['actions']:.2f} actions, "
                f"{figures['switches']:.2f} switches, decisions {figures['decision_ms']['median']:.3f} ms, "
                f"p99 {figures['decision_ms']['p99']:.1f} ms"
            )
        seconds = sum(figures["seconds"] for figures in results.values())
        pace = f"{seconds / elapsed:,.0f} times real time"
        yield f"arm {seed}: {len(planned)} x {EPISODES} movements in {elapsed:.1f} s, {pace}"
