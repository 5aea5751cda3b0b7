"""The hitch after 14 h of rest (section 5.5.1, figures 5.13, 5.14): does the agent adapt, or does the arm warm up?

The thesis saw its learning agent drop after a night and recover in 2000 movements, and could not tell whether the
agent or the arm had come back. Here an agent moves for a day, the arm rests, and it moves again: learning on both
days, learning on the first alone, or never learning (so that what comes back is the arm); and one that learns on
without a night, because what a learning agent earns goes up and down anyway.

    pneumarm experiment overnight
"""

from pneumarm.experiments.overnight.days import Overnight

EXPERIMENT = Overnight()
