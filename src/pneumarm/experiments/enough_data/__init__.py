"""How many minutes of collecting does an agent need?

Factor: the time on the arm's clock that collecting may take, from what 1,000 transitions take, the fewest that can be
fitted, to 220 minutes. One collection is cut short after each of these; from each part alone a simulation is fitted
and the thesis' agent trained and moved on the arm. Goals and begin states are the same for all parts.

    pneumarm experiment enough-data --out laboratory
"""

from pneumarm.experiments.enough_data.minutes import EnoughData

EXPERIMENT = EnoughData()
