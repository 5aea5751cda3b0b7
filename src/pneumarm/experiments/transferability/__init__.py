"""What is left of each agent on the arm (sections 3.4, 5.4.1, 5.4.2, 5.4.4)?

The thesis expects that switches make an agent hard to transfer, asks what is left of agents that learned without
shaping, and adds noise to the simulation for the sake of the transfer; it transferred one agent only. Here agents
of every kind begin with the same weights, the best of eight by its own validation comes to the arm as it is in the
morning, and all are judged by the same reward, in the simulation with the thesis' noise and on the arm: greedy and
without learning.

    pneumarm experiment transferability

Answer here, on five arms: trial 10 loses 3 ± 3 of its reward on the way to the arm, and no other kind of agent
significantly loses more or less. They differ in what they earn in either place: without shaping 12 less on the arm,
and without the punishment a third of the movements fail, so that no more is lost by the transfer.
"""

from pneumarm.experiments.transferability.kinds import Transferability

EXPERIMENT = Transferability()
