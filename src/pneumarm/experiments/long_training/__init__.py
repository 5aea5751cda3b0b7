"""Training on to 50,000 episodes (section 5.4.3, appendix C.3): do slow learners outperform fast ones in the end?

The runs of all-goals, trained on (thesis: the first three); ``gain`` is what that changed in the reward.

    pneumarm experiment long-training
"""

from pneumarm.experiments.all_goals import BASE
from pneumarm.experiments.design.assignment import thesis_design
from pneumarm.experiments.design.table import packaged_results
from pneumarm.experiments.factorial import ALL, EffectClaim, Factorial
from pneumarm.experiments.findings import gains, trial_10
from pneumarm.experiments.words import words_of

EXPERIMENT = Factorial(
    name="long-training",
    words=words_of(__name__),
    runs=4,
    design=thesis_design(),
    base=BASE,
    thesis=packaged_results(__name__, "reward", "gain", "actions", "switches"),
    continued=50_000,
    criteria=("gain", *ALL),
    effect_claims=(EffectClaim("gain", 4, raises=True, loss="std", about="q-fluctuates"),),
    cited={
        "gain": {
            "runs": "fig. C.21",
            "half-normal runs": "figs. C.22 and C.23",
            "mean": "figs. 5.7 and C.24",
            "std": "figs. 5.8 and C.25",
            "half-normal": "figs. C.26 and C.27",
            "ranking": "table 5.9",
        },
        "reward": {"results": "tables 5.8 and C.11", "runs": "fig. C.19", "half-normal runs": "fig. C.20"},
        "actions": {"results": "table C.12", "mean": "fig. C.28", "half-normal": "figs. C.30 and C.31"},
        "switches": {"results": "table C.13", "mean": "fig. C.32", "half-normal": "figs. C.34 and C.35"},
    },
    findings=(gains, trial_10),
)
