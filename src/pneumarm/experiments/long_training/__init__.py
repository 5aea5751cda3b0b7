"""Training on to 50,000 episodes (section 5.4.3, appendix C.3): do slow learners outperform fast ones in the end?

The first three runs of all-goals, trained on; ``gain`` is what that changed in the reward.

    pneumarm experiment long-training

On the nominal virtual arm (seed 0) training on raises the reward by 14 on average, four times as much as in the
thesis, and no factor decides by how much.
"""

from pneumarm.experiments.all_goals import BASE
from pneumarm.experiments.design.assignment import thesis_design
from pneumarm.experiments.design.table import packaged_table
from pneumarm.experiments.factorial import ALL, Factorial, Said
from pneumarm.experiments.findings import training_on_improves, training_on_improves_little, trial_10_is_good

EXPERIMENT = Factorial(
    name="long-training",
    title="All goal angles with 50,000 episodes",
    question="Do agents that learn slowly outperform the fast ones in the end, and who gains by training on?",
    source="Thesis section 5.4.3, appendix C.3",
    runs=3,
    design=thesis_design(),
    base=BASE,
    thesis={name: packaged_table(__name__, f"thesis_{name}") for name in ("reward", "gain", "actions", "switches")},
    continued=50_000,
    criteria=("gain", *ALL),
    said=(Said("gain", 4, raises=True, loss="std", about="q-fluctuates"),),
    findings=(training_on_improves, training_on_improves_little, trial_10_is_good),
)
