"""What a guarantee costs: agents that reach goals, alone and behind the filter that passes what brings goals nearer.

python -m benchmarks guarantee

Settings come from the environment:

PNEUMARM_GUARANTEE_ARMS       seeds of virtual arms, "1"; the held-out arms are 1001 to 1010
PNEUMARM_GUARANTEE_METHODS    "esp,policy"; the policy does not look ahead
PNEUMARM_GUARANTEE_MOVEMENTS  movements on the arm for each agent, 100
PNEUMARM_GUARANTEE_FOLDER     where collected stores are kept; a temporary folder by default
"""

import time
from collections.abc import Iterator

import numpy as np

from benchmarks import _environment as environment
from benchmarks._trials import collected, fitted, greedy_movements
from pneumarm.control import AgentController
from pneumarm.learning import PolicySettings, train
from pneumarm.learning.evolution import EvolutionSettings
from pneumarm.learning.guarantee.actor import GuaranteedActor

TRANSITIONS = 100_000
METHODS = {"esp": EvolutionSettings(), "policy": PolicySettings(lookahead=0)}


def measure() -> Iterator[str]:
    """Yield two lines for each agent on each arm."""
    methods = environment.several("PNEUMARM_GUARANTEE_METHODS", METHODS)
    movements = environment.whole("PNEUMARM_GUARANTEE_MOVEMENTS", 100)
    with environment.kept_folder("PNEUMARM_GUARANTEE_FOLDER") as folder:
        for arm in environment.seeds("PNEUMARM_GUARANTEE_ARMS", "1"):
            store = folder / f"arm-{arm}.db"
            if not store.exists():
                collected(store, arm, arm, TRANSITIONS)
            made, begin = fitted(store, arm)
            for method in methods:
                agent = train(made.simulation, begin, METHODS[method], 0).agent
                actor = GuaranteedActor(agent)
                for name, controller in (("alone", None), ("filtered", AgentController(agent, actor))):
                    began = time.thread_time()
                    moved = greedy_movements(agent, arm, made.simulation.goal_range, range(movements), 0, controller)
                    spent = 1e3 * (time.thread_time() - began) / sum(one.actions for one in moved)
                    success, reward = (np.mean([getattr(one, of) for one in moved]) for of in ("success", "reward"))
                    actions = np.mean([one.actions for one in moved])
                    yield (
                        f"arm {arm}, {method} {name}: success {success:.3f}, reward {reward:.1f}, "
                        f"actions {actions:.1f}, {spent:.1f} ms of a core an action"
                    )
                decided = np.array([actor.passed, actor.replaced, actor.without])
                passed, replaced, without = 100 * decided / decided.sum()
                yield (
                    f"arm {arm}, {method}: {passed:.0f} % of actions passed, {replaced:.0f} % replaced, "
                    f"{without:.0f} % without a guarantee"
                )
