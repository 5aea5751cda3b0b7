"""What precision costs (section 5.1): goals of 25 and 12 counts, and speeds at the goal of 1 and 0.5 counts/ms.

The thesis takes 25 counts and 1 count/ms (eq. 5.1, 5.2), "partly by empirical observations", and supposes that 0.5
may be possible. Agents learn each goal area by themselves and are tested with it, in the simulation and on the arm
as it is in the morning: greedy and without learning, the same begin states and goals.

    pneumarm experiment goal-area
"""

from pneumarm.experiments.goal_area.areas import GoalArea

EXPERIMENT = GoalArea()
