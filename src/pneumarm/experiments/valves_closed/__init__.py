"""Should the valves be closed while the sensors are read and the next action is chosen?

Factor: valves left as they are, or closed in that time (figure 2.8). Transitions are collected, a simulation is
fitted, an agent trained and moved on the arm each way. Besides, a muscle is inflated through some control periods
each way and watched every millisecond, which is figure 2.8 measured.

    pneumarm experiment valves-closed --out laboratory
"""

from pneumarm.experiments.valves_closed.inflation import ValvesClosed

EXPERIMENT = ValvesClosed()
