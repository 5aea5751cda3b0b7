"""Actions and switches by displacement, typical movements, and small displacements as the hard case (section 5.5.2).

The agent of trial 10 learns on the arm with 0.10 until it has adapted, and the movements after that are looked at,
still learning and exploring. Then it makes movements of 5, 30 and 60 degrees greedily, as in figures 5.17 to 5.19,
and what the arm does after the goal is reached is recorded too.

Differences from the thesis: 1000 movements to adapt, not 2500; 60 degrees, not 70, which is more than the range of
goals of some arms.

    pneumarm experiment displacement
"""

from pneumarm.experiments.displacement.typical import Displacement

EXPERIMENT = Displacement()
