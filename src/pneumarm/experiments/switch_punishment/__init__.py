"""Punishing a switch (section 5.4.1, appendix C.1): what does it do to the movements, and to the training?

As all-goals, with the punishment (-8 or none) in place of the discount factor and the single goal 650 (thesis: three
runs).

    pneumarm experiment switch-punishment
"""

from pneumarm.experiments.all_goals import BASE
from pneumarm.experiments.design.assignment import packaged_design
from pneumarm.experiments.design.table import packaged_results
from pneumarm.experiments.factorial import EffectClaim, Factorial
from pneumarm.experiments.findings import punishment
from pneumarm.experiments.words import words_of

EXPERIMENT = Factorial(
    name="switch-punishment",
    words=words_of(__name__),
    runs=4,
    design=packaged_design(__name__),
    base=BASE,
    thesis=packaged_results(__name__, "reward", "actions", "switches", "episodes"),
    goal=650.0,
    effect_claims=(
        EffectClaim("switches", 12, raises=True, about="punishment"),
        EffectClaim("actions", 12, raises=False, about="punishment"),
        EffectClaim("episodes", 12, raises=True, about="punishment-episodes"),
    ),
    cited={
        "reward": {"results": "table C.2"},
        "switches": {"results": "table C.3"},
        "actions": {"results": "table C.4"},
        "episodes": {"results": "table C.5"},
    },
    findings=(punishment,),
)
