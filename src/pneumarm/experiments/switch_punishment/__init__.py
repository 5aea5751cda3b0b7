"""Punishing a switch (section 5.4.1, appendix C.1): what does it do to the movements, and to the training?

As all-goals, with the punishment (-8 or none) in place of the discount factor and the single goal 650; three runs.

    pneumarm experiment switch-punishment

On the nominal virtual arm (seed 0) agents that are punished switch 1.4 times a movement, others 4.2 times: less than
half, as in the thesis. They also need fewer actions (12.5 against 17.8), where the thesis' need more.
"""

from pneumarm.experiments.all_goals import BASE
from pneumarm.experiments.design.assignment import packaged_design
from pneumarm.experiments.design.table import packaged_table
from pneumarm.experiments.factorial import Factorial, Said
from pneumarm.experiments.findings import punishment_costs_actions, punishment_halves_switches

EXPERIMENT = Factorial(
    name="switch-punishment",
    title="Punishing a switch",
    question="What does a punishment of -8 for a switch do to the movements, and to the training?",
    source="Thesis section 5.4.1, appendix C.1",
    runs=3,
    design=packaged_design(__name__),
    base=BASE,
    thesis={
        name: packaged_table(__name__, f"thesis_{name}") for name in ("reward", "actions", "switches", "episodes")
    },
    goal=650.0,
    said=(
        Said("switches", 12, raises=True, about="punishment"),
        Said("actions", 12, raises=False, about="punishment"),
        Said("episodes", 12, raises=True, about="punishment-episodes"),
    ),
    findings=(punishment_halves_switches, punishment_costs_actions),
)
