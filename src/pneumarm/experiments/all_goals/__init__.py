"""All goal angles (section 5.4.2, appendix C.2): which settings of the learning method matter, and which are best?

Five factors of the method on L16, runs from different weights (thesis: eight), tested on all goals.

    pneumarm experiment all-goals
"""

from dataclasses import replace

from pneumarm.experiments.design.assignment import thesis_design
from pneumarm.experiments.design.table import packaged_results
from pneumarm.experiments.factorial import EffectClaim, Factorial
from pneumarm.experiments.findings import (
    fewest_switches,
    off_policy,
    success,
    traces,
    trial_10,
    weights_and_columns,
    weights_and_settings,
)
from pneumarm.experiments.words import words_of
from pneumarm.learning import TrainSettings

LONGEST = 50_000
"""Episodes after which a training that does not meet the criterion ends (the thesis' longest took 48,000)."""
BASE = replace(TrainSettings(), max_episodes=LONGEST)
"""What no factor sets (section 5.4.2)."""

EXPERIMENT = Factorial(
    name="all-goals",
    words=words_of(__name__),
    runs=4,
    design=thesis_design(),
    base=BASE,
    thesis=packaged_results(__name__, "reward", "actions", "switches", "episodes"),
    effect_claims=(
        EffectClaim("reward", 4, raises=False, about="sarsa"),
        EffectClaim("reward", 4, raises=True, loss="std", about="sarsa"),
        EffectClaim("reward", 8, raises=False, loss="std", about="column-8"),
        EffectClaim("reward", 2, raises=False, about="neurons"),
        EffectClaim("reward", 2, raises=True, loss="std", about="neurons"),
        EffectClaim("reward", 1, raises=False, about="learning-rate"),
        EffectClaim("reward", 1, raises=False, about="learning-rate", slight=8.0),
        EffectClaim("reward", 1, raises=True, loss="std", about="learning-rate"),
        EffectClaim("reward", 11, raises=False, about="traces"),
        EffectClaim("reward", 12, raises=True, about="gamma"),
        EffectClaim("reward", 12, raises=True, loss="std", about="gamma"),
        EffectClaim("episodes", 12, raises=False, about="gamma-episodes"),
        EffectClaim("episodes", 11, raises=True, about="traces"),
    ),
    cited={
        "reward": {
            "results": "tables 5.5 and C.7",
            "runs": "figs. 5.1 and C.1",
            "half-normal runs": "fig. C.2",
            "mean": "figs. 5.2 and C.3",
            "std": "figs. 5.3 and C.4",
            "half-normal": "figs. 5.4, 5.5, C.5 and C.6",
            "ranking": "table 5.6",
        },
        "actions": {
            "results": "table C.8",
            "mean": "fig. C.7",
            "std": "fig. C.8",
            "half-normal": "figs. C.9 and C.10",
        },
        "switches": {
            "results": "table C.9",
            "mean": "fig. C.11",
            "std": "fig. C.12",
            "half-normal": "figs. C.13 and C.14",
        },
        "episodes": {
            "results": "table C.10",
            "mean": "figs. 5.6 and C.15",
            "std": "fig. C.16",
            "half-normal": "figs. C.17 and C.18",
        },
    },
    findings=(
        weights_and_settings,
        weights_and_columns,
        traces,
        trial_10,
        success,
        fewest_switches,
        off_policy,
    ),
)
