"""From the simulation to the arm (section 5.5.1): what is lost on arrival, through what, and who gets it back?

The agent of trial 10, the best of eight of its run, comes to the arm in the morning after a night of rest. Trials 1
to 3 are the thesis' three agents: they explore as at the end of their training and learn with 0, 0.05 and 0.10.
Trials 4 to 8 take the drop apart: the same agent, greedy and without learning, makes the same movements on the arm
as it is, on one whose sensors have no noise, on one that is never late, on one that has moved for an hour, and on one
with all three; what still differs from the simulation is the error of the model. The thesis could not tell these
apart.

    pneumarm experiment transfer
"""

from pneumarm.experiments.transfer.conditions import TransferToTheArm

EXPERIMENT = TransferToTheArm()
