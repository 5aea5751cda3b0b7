"""No shaping (section 5.4.4, appendix C.5): is shaping needed, and which settings are best without it?

As all-goals, from all begin states from the first episode on, epsilon 0.09 and T 10 throughout (thesis: three
runs). The end of training is looked for after every episode, as table C.22 shows.

    pneumarm experiment no-shaping
"""

from dataclasses import replace

from pneumarm.experiments.all_goals import BASE
from pneumarm.experiments.design.assignment import thesis_design
from pneumarm.experiments.design.table import packaged_results
from pneumarm.experiments.factorial import Factorial
from pneumarm.experiments.findings import criterion_met
from pneumarm.experiments.words import words_of
from pneumarm.learning import Exploration

EXPERIMENT = Factorial(
    name="no-shaping",
    words=words_of(__name__),
    runs=4,
    design=thesis_design(),
    base=replace(BASE, shaping=None, exploration=Exploration(0.09, 10.0)),
    thesis=packaged_results(__name__, "reward", "actions", "switches", "episodes"),
    cited={
        "reward": {"results": "table C.21"},
        "actions": {"results": "table C.19"},
        "switches": {"results": "table C.20"},
        "episodes": {"results": "table C.22"},
    },
    findings=(criterion_met,),
)
