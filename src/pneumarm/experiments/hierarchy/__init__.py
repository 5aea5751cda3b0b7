"""Does an upper agent that sets subgoals help (section 6.2)?

The thesis proposes it and did not try. An upper agent sets each joint an angle on the way to its goal, lower ones,
one a joint with the thesis' networks, hold the valves; they are paid for their subgoals, and besides for the goal of
both. The upper agent sees angles and goals alone, as [15] asks for, or all that the lower agents see. Flat agents,
with a common goal and with goals of their own, have as many episodes at most. One goal, that in the middle, and all
goals are learned.

    pneumarm experiment hierarchy --out laboratory
"""

from pneumarm.experiments.hierarchy.levels import Levels

EXPERIMENT = Levels()
