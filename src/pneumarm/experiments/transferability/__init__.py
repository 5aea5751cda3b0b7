"""What is left of each agent on the arm (sections 3.4, 5.4.1, 5.4.2, 5.4.4)?

The thesis expects that switches make an agent hard to transfer, asks what is left of agents that learned without
shaping, and adds noise to the simulation for the sake of the transfer; it transferred one agent only. Here agents
of every kind begin with the same weights, the best of eight by its own validation comes to the arm as it is in the
morning, and all are judged by the same reward, in the simulation with the thesis' noise and on the arm: greedy and
without learning.

    pneumarm experiment transferability
"""

from pneumarm.experiments.transferability.kinds import Transferability

EXPERIMENT = Transferability()
