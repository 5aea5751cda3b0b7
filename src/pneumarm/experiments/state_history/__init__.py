"""Which history must the state hold, and does the time between readings belong into it?

Factors: the number of observations in the state, 1 (the last one alone) to 4, with the actions between them; the
networks with and without the length of the step that is predicted. All are fitted to the same transitions and judged
on the same held-out sequences, so the states are nested. An agent cannot know how long a step will be, so agents are
trained and moved on the arm only without it.

    pneumarm experiment state-history --out laboratory
"""

from pneumarm.experiments.state_history.histories import StateHistory

EXPERIMENT = StateHistory()
